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

// Where the page says what an option of the shell says: the control of each, whose label names it.
const CONTROLS = { material: "material", discrepancy: "discrepancy", estimand: "estimand", "noise-sd": "noise", "stable-in": "stable", specimen: "one-specimen",
  at: "stretch", at2: "stretch2", format: "format",
  ...Object.fromEntries(["preload", "cycle", "branch", "every", "leave-out", "until-peak", "zero", "load-zero", "compliance", "turn", "strain-type", "stress-type", "stress-unit", "strain-unit",
    "incompressible", "axial-stretch"].map(name => [name, name.replaceAll("-", "_")])) };
const OPTION = /--([a-z]+(?:-[a-z]+)*\d?)(?: ("[^"]*"|'[^']*'|[^\s;,()'"]*[^\s;,.:()'"]))?( once for each)?/g;

// A message of the answer, with the controls of the page where it names options of the shell.
export const onPage = text => text.replace(OPTION, (typed, name, value, each) => {
  if (name === "material" && value === "all") return `“${byId("laws").querySelector("summary").textContent}”, below`;
  const control = byId(CONTROLS[name]) ?? byId("reading").elements[CONTROLS[name]];
  const label = control?.labels?.[0], words = label && [...label.childNodes].filter(node => node.nodeType === Node.TEXT_NODE).map(node => node.data).join("").trim();
  if (!words || text.includes("tissuq fit") && name === "material") return typed;
  return control.type === "checkbox" ? `“${words}”${["specimen", "stable-in"].includes(name) || !value ? "" : ` ${value}`}` : `“${words}”${value ? `${name.startsWith("at") ? "" : ":"} ${value}` : ""}${each ?? ""}`;
});

export const warningsOf = warnings => warnings.map(warning => make("p", {
  className: `warning ${warning.severity ?? ""}`, textContent: onPage(warning.text ?? warning) }));
