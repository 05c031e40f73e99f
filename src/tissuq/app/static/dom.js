// Elements, requests and what is repeated on the page.
export const byId = id => document.getElementById(id);

export const make = (name, attributes = {}, ...children) => {
  const { data, aria, ...rest } = attributes;
  const made = Object.assign(document.createElement(name), rest);
  for (const [key, value] of Object.entries(aria ?? {})) made.setAttribute(`aria-${key}`, value);
  Object.assign(made.dataset, data ?? {});
  made.append(...children.filter(child => child != null));
  return made;
};

export const fill = (place, ...children) => place.replaceChildren(...children.filter(child => child != null));

export const button = (words, click, attributes = {}) => {
  const made = make("button", { type: "button", textContent: words, ...attributes });
  made.addEventListener("click", click);
  return made;
};

export const options = (select, items, empty = null) => {
  fill(select, empty == null ? null : make("option", { value: "", textContent: empty }),
    ...items.map(item => make("option", typeof item === "string" ? { value: item, textContent: item } : item)));
  return select;
};

export const alertOf = message => fill(byId("alert"), message ? make("div", { className: "warning problem" },
  make("span", { textContent: message + " " }), button("Close", () => alertOf(""), { className: "small" })) : null);

export const request = async (path, settings = {}) => {
  let response;
  try {
    response = await fetch(path, settings);
  } catch {
    throw new Error("tissuq does not answer: was it ended in the terminal? Start 'tissuq app' again.");
  }
  const answer = await response.json().catch(() => ({ error: `the page was refused (${response.status}).` }));
  if (!response.ok) throw new Error(answer.error);
  return answer;
};

const copyable = (title, text) => {
  const said = make("span", { className: "soft", role: "status" });
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text);
      said.textContent = "copied";
    } catch {
      const range = document.createRange();
      range.selectNodeContents(code);
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      said.textContent = "marked: press Ctrl-C";
    }
  };
  const code = make("pre", { textContent: text, tabIndex: 0 });
  return make("div", {}, make("div", { className: "head" }, make("span", { textContent: title }),
    button("Copy", copy, { className: "small", aria: { label: `Copy: ${title}` } }), said), code);
};

export const repeatOf = repeat => make("details", { className: "repeat" },
  make("summary", { textContent: "Repeat this without the page" }),
  make("p", { className: "soft", textContent: "In the folder of your files:" }),
  copyable("Command line", repeat.shell), copyable("Python", repeat.python));

export const tableOf = (headers, rows, caption) => make("div", { className: "scroll", tabIndex: 0, role: "region", aria: { label: caption } },
  make("table", {}, make("thead", {}, make("tr", {}, ...headers.map(text => make("th", { textContent: text, scope: "col" })))),
    make("tbody", {}, ...rows.map(row => make("tr", {}, ...row.map(text => make("td", { textContent: text })))))));

export const warningsOf = warnings => warnings.map(warning => make("p", {
  className: `warning ${warning.severity ?? ""}`, textContent: warning.text ?? warning }));
