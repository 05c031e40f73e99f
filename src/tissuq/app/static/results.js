// The answer, and what comes of going on from it.
import { byId, fill, make, onPage, repeatOf, tableOf, warningsOf } from "./dom.js";

export const showAnswer = answer => {
  const [first, ...others] = answer.numbers, number = item => [`${item.name} `, make("strong", { textContent: item.text }), make("span", { textContent: ` ${item.remark}` })];
  fill(byId("answer-body"),
    ...warningsOf(answer.shown.filter(warning => warning.severity === "problem")),
    make("div", { className: "numbers" },
      make("p", { className: "soft", textContent: answer.title }),
      make("p", { className: "first" }, ...number(first)),
      ...others.map(item => make("p", {}, ...number(item))),
      make("p", { className: "soft", textContent: answer.finding })),
    make("ul", { className: "uses" }, ...answer.uses.map(use => make("li", { className: use.verdict.split(" ")[0] },
      make("strong", { textContent: `${use.verdict.toUpperCase()}: ` }), use.purpose, make("span", { textContent: use.reason })))),
    make("p", {}, make("strong", { textContent: "Next: " }), onPage(answer.next)),
    ...warningsOf(answer.shown.filter(warning => warning.severity !== "problem")),
    answer.folded.length ? make("details", {}, make("summary", { textContent: `Further warnings and notes: ${answer.folded.length}` }), ...warningsOf(answer.folded)) : null,
    repeatOf(answer.repeat));
};

export const reportOf = (address, title) => make("div", {},
  make("p", {}, make("a", { href: address, target: "_blank", rel: "noopener", textContent: "Open the report in a tab of its own" })),
  make("iframe", { src: address, title }));

export const showLaws = (found, address, zip) => fill(byId("laws-result"),
  make("p", { textContent: found.lead }), tableOf(found.headers, found.rows, "Laws"),
  ...Object.entries(found.skipped).map(([name, reason]) => make("p", { className: "soft", textContent: `Not fitted: ${name}: ${reason}` })),
  found.warnings.length ? make("details", {}, make("summary", { textContent: `Warnings and notes: ${found.warnings.length}` }), ...warningsOf(found.warnings)) : null,
  repeatOf(found.repeat), make("p", {}, make("a", { className: "button", href: zip, textContent: "Download the comparison (zip)" })), reportOf(address, "Report of the comparison"));

export const showPrediction = (found, address, zip) => fill(byId("predict-result"),
  ...warningsOf(found.warnings), make("h3", { textContent: found.title }), tableOf(found.headers, found.rows, found.title), repeatOf(found.repeat),
  make("p", {}, make("a", { className: "button", href: zip, textContent: "Download the prediction (zip)" })), reportOf(address, "Report of the prediction"));

export const showCards = (found, zip) => fill(byId("export-result"),
  make("ul", {}, ...found.explanations.map(text => make("li", { textContent: onPage(text) }))),
  make("p", {}, make("a", { className: "button", href: zip, textContent: `Download ${found.files.length} cards (zip)` })),
  make("details", {}, make("summary", { textContent: `The first card, ${found.files[0]}` }), make("pre", { textContent: found.example, tabIndex: 0 })),
  repeatOf(found.repeat));
