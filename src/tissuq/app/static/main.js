// The flow of the page: files, what was understood, fit, answer, and what follows.
import { alertOf, button, byId, fill, make, onPage, options, request } from "./dom.js";
import { showFound } from "./reading.js";
import { reportOf, showAnswer, showCards, showLaws, showPrediction } from "./results.js";

const state = { session: "", files: [], renamed: {}, reading: {}, modes: {}, found: null, settled: new Set(), answer: null, fitted: null, begun: {} };
const listeners = new Map(), early = new Map(), MAX_NAME = 200, KEPT = "tissuq";
const own = path => `sessions/${state.session}/${path}`;
const result = path => own(`results/${path.split("/").map(encodeURIComponent).join("/")}`), zip = path => own(`zip/${path.split("/").map(encodeURIComponent).join("/")}`);
const safely = work => async (...values) => { try { await work(...values); } catch (error) { alertOf(error.message); } };

const hear = event => {
  const news = JSON.parse(event.data);
  if (listeners.has(news.task)) listeners.get(news.task)(news);
  else early.set(news.task, [...(early.get(news.task) ?? []), news]);
};

// Begins a task, unless it has a number already; heard(kind, data) gets its news, of which the first is its number.
const begin = async (task, values, heard, earlier = null) => {
  const number = earlier ?? (await request(own(`tasks/${task}`), { method: "POST", body: JSON.stringify(values) })).task;
  listeners.set(number, news => {
    if (["done", "error", "stopped"].includes(news.kind)) listeners.delete(number);
    heard(news.kind, news.data);
  });
  heard("begun", number);
  for (const news of early.get(number) ?? []) listeners.get(number)?.(news);
  early.delete(number);
};
const stop = number => request(own(`tasks/${number}`), { method: "DELETE" }).catch(() => {});

// Begins a task whose stages are shown, with a button that stops it; or shows one that was begun before the page was loaded again.
const beginShown = async (task, values, earlier = null) => {
  alertOf("");
  const place = byId(`${task}-progress`), submit = byId(`${task}-form`).querySelector("[type=submit]"), before = state.begun[task];
  const stages = make("ol", { className: "stages", aria: { live: "polite" } }), bar = make("progress", { aria: { label: "working" } });
  submit.disabled = true;
  let number = null, asked = false;
  const cancel = button("Cancel", () => { asked = true; cancel.disabled = true; if (number != null) stop(number); });
  const add = words => { stages.querySelector(".now")?.classList.remove("now"); stages.append(make("li", { className: "now", textContent: words })); };
  const end = (...shown) => { submit.disabled = false; fill(place, ...shown); };
  const fail = (...shown) => { state.begun[task] = before; end(make("p", ...shown)); };
  fill(place, stages, bar, make("p", {}, cancel));
  add("waiting for a free process (at the start it takes some seconds to get ready)");
  const news = (kind, data) => {
    if (kind === "begun") {
      number = data;
      state.begun[task] = { number, values };
      if (asked) stop(number);
    } else if (kind === "start") stages.replaceChildren();
    else if (kind === "step") add(data);
    else if (kind === "error") fail({ className: "warning problem", role: "alert", textContent: onPage(data.text) });
    else if (kind === "stopped") fail({ className: "soft", role: "status", textContent: "Stopped. Nothing was kept of it." });
    else { if (kind === "done") end(); HEARD[task](kind, data, values); }
  };
  try {
    await begin(task, values, news, earlier);
  } catch (error) { fail({ className: "warning problem", role: "alert", textContent: error.message }); }
};

const measured = () => {
  const modes = state.files.map(file => state.modes[file] ?? "");
  const seen = file => state.found?.tests.find(test => test.file === file)?.mode ?? "";
  return { files: state.files, reading: state.reading, modes: modes.some(Boolean) ? modes.map((mode, i) => mode || seen(state.files[i])) : [] };
};
const fitted = () => { // with a mode for every test: one file may hold tests in several
  const { modes, ...request } = measured(), tests = state.found?.tests ?? [];
  const are_said = modes.length || (tests.length > 1 && tests.some(test => test.is_mode_assumed)); // of several tests none is assumed unsaid
  return { ...request, modes: are_said ? tests.map(test => state.modes[test.file] || test.mode) : [] };
};

const changedSince = () => { byId("stale").hidden = !state.answer || state.fitted === JSON.stringify({ ...fitted(), ...fitOptions() }); };

let inspection = 0;
const inspect = safely(async () => {
  const turn = ++inspection;
  byId("understood").hidden = !state.files.length;
  byId("fitting").hidden = true;
  showFiles();
  changedSince();
  if (!state.files.length) {
    state.found = null;
    for (const id of ["refusal", "questions", "tests", "findings"]) fill(byId(id));
    return;
  }
  byId("understood").setAttribute("aria-busy", "true");
  await begin("inspect", measured(), (kind, data) => {
    if (turn !== inspection || !["done", "error"].includes(kind)) return;
    byId("understood").removeAttribute("aria-busy");
    if (kind === "error") { alertOf(data.text); return; }
    state.found = data;
    showFound(data, state.reading, state.settled, { change, answer, leave });
    byId("fitting").hidden = Boolean(data.error) || !data.tests.length;
    for (const place of document.querySelectorAll(".unit")) place.textContent = data.tests[0]?.unit ?? "";
    showFiles();
    changedSince();
  });
});

const change = update => {
  const reading = update(state.reading);
  state.reading = Object.fromEntries(Object.entries(reading).filter(([, value]) => value != null && value !== "" && !(typeof value === "object" && !Object.keys(value).length)));
  inspect();
};
const answer = (question, settings) => {
  const { mode, ...reading } = settings;
  if (mode) for (const file of state.files) if (file === question.file || !state.modes[file]) state.modes[file] = mode;
  change(now => ({ ...now, ...reading }));
};
const leave = question => { state.settled.add(question.text); showFound(state.found, state.reading, state.settled, { change, answer, leave }); };

const showFiles = () => fill(byId("file-list"), ...state.files.map(file => {
  const select = options(make("select", { aria: { label: `Loading mode of ${file}` } }), state.choices.modes.map(({ name, words }) => ({ value: name, textContent: `${name}: ${words}` })), "loading mode: as the file says");
  select.value = state.modes[file] ?? "";
  select.addEventListener("change", () => { state.modes[file] = select.value; inspect(); });
  const remove = safely(async () => { state.files = (await request(own(`files/${encodeURIComponent(file)}`), { method: "DELETE" })).files; delete state.modes[file]; inspect(); });
  return make("li", {}, make("span", { className: "name", textContent: file }), select, button("Remove", remove, { className: "small", aria: { label: `Remove ${file}` } }),
    state.renamed[file] ? make("p", { className: "soft", textContent: `Your file '${state.renamed[file]}' is called so here; to repeat the commands of this page give it this name.` }) : null);
}));

const upload = safely(async files => {
  await state.prepared;
  alertOf("");
  const problems = [];
  for (const file of files) {
    if (file.size > state.limit.bytes) { problems.push(`'${file.name}' is too large for this page (${state.limit.words} at most). Take fewer rows, or use the command line, which has no limit: tissuq fit '${file.name}'.`); continue; }
    try {
      const { name, files: all } = await request(own(`files?name=${encodeURIComponent(file.name.slice(-MAX_NAME))}`), { method: "POST", body: file });
      state.files = all;
      state.renamed[name] = name === file.name.normalize("NFC") ? "" : file.name;
    } catch (error) { problems.push(error.message); }
  }
  await inspect();
  alertOf(problems.join(" "));
});

const fitOptions = () => ({
  material: byId("material").value, discrepancies: byId("discrepancy").value ? [byId("discrepancy").value] : [], estimand: byId("estimand").value,
  noise_sd: byId("noise").value.trim() ? Number(byId("noise").value) : null, stable_in: byId("stable").checked ? ["all"] : [],
  is_one_specimen: byId("one-specimen").checked });

// What comes of tasks whose stages are shown.
const HEARD = {
  fit: (kind, data, values) => {
    if (kind === "answer") {
      state.answer = data;
      state.fitted = JSON.stringify(values);
      showAnswer(data);
      byId("answer").hidden = false;
      byId("further").hidden = true;
      fill(byId("report"));
      changedSince();
      byId("answer-title").focus({ preventScroll: true });
      byId("answer-title").scrollIntoView({ block: "start" });
    } else if (kind === "done") {
      fill(byId("report"), make("h3", { textContent: "The report" }), reportOf(result(data.report), "Report of the fit"));
      for (const id of ["laws", "predict", "export"]) { fill(byId(`${id}-result`)); fill(byId(`${id}-progress`)); if (state.begun[id]?.number < state.begun.fit.number) delete state.begun[id]; }
      byId("zip").href = zip(`runs/${data.run}`);
      byId("mode").value = state.choices.modes.find(mode => !state.answer.modes.includes(mode.name) && mode.controls.length === 1)?.name ?? "";
      byId("further").hidden = false;
    }
  },
  laws: (kind, data) => { if (kind === "done") showLaws(data, result(data.report), zip(`runs/${data.run}`)); },
  predict: (kind, data) => { if (kind === "done") showPrediction(data, result(data.report), zip(`runs/${data.run}`)); },
  export: (kind, data) => { if (kind === "done") showCards(data, zip(data.folder)); },
};

const fit = safely(async event => {
  event.preventDefault();
  if (byId("noise").value.trim() && !(Number(byId("noise").value) > 0)) throw new Error("The noise is a positive number with a decimal point, or nothing.");
  await beginShown("fit", { ...fitted(), ...fitOptions() });
});
const compare = safely(async event => {
  event.preventDefault();
  const chosen = [...byId("law-list").querySelectorAll("input:checked")].map(box => box.value), isAll = byId("all-laws").checked;
  if (!isAll && chosen.length < 2) throw new Error("Choose two laws or more, or all of them.");
  const { material, ...asked } = { ...JSON.parse(state.fitted), ...fitOptions() };
  await beginShown("laws", { ...asked, laws: isAll ? ["all"] : chosen });
});
const predict = safely(async event => {
  event.preventDefault();
  const values = Object.fromEntries(new FormData(byId("predict-form")));
  if (byId("stretch2-line").hidden) delete values.stretch2;
  await beginShown("predict", { ...values, run: state.answer.run });
});
const exportCards = safely(async event => {
  event.preventDefault();
  const values = Object.fromEntries(new FormData(byId("export-form")));
  await beginShown("export", { ...values, draws: Number(values.draws), all_draws: byId("all-draws").checked, run: state.answer.run });
});

const showChoices = choices => {
  state.choices = choices;
  options(byId("material"), choices.materials.map(item => item.name));
  byId("material").value = "neo-hookean";
  const explain = () => { byId("material-words").textContent = `W = ${choices.materials.find(item => item.name === byId("material").value).words}`; };
  byId("material").addEventListener("change", explain);
  explain();
  options(byId("discrepancy"), choices.discrepancies.map(item => item.name).filter(name => name !== "auto"), "auto: let the data say");
  options(byId("estimand"), choices.estimands.map(item => ({ value: item.name, textContent: `${item.name}: ${item.words}` })), "the specimen; the tissue for several specimens");
  options(byId("mode"), choices.modes.map(mode => ({ value: mode.name, textContent: `${mode.name}: ${mode.words}` })));
  options(byId("format"), choices.formats);
  fill(byId("law-list"), ...choices.materials.filter(item => item.is_isotropic).map(item => make("label", {}, make("input", { type: "checkbox", value: item.name }), ` ${item.name}`)));
  const second = () => { byId("stretch2-line").hidden = (choices.modes.find(mode => mode.name === byId("mode").value)?.controls.length ?? 1) < 2; };
  byId("mode").addEventListener("change", second);
  byId("all-laws").addEventListener("change", () => { for (const box of byId("law-list").querySelectorAll("input")) box.disabled = byId("all-laws").checked; });
};

// The tab keeps what was chosen and begun, for when its page is loaded again; the files stay with tissuq for a while.
const choicesOf = () => [...byId("fit-form").elements].filter(input => input.id && input.type !== "submit");
const keep = () => {
  const { session, files, renamed, reading, modes, settled, begun } = state, choices = choicesOf().map(input => [input.id, input.type === "checkbox" ? input.checked : input.value]);
  sessionStorage.setItem(KEPT, JSON.stringify({ session, files, renamed, reading, modes, settled: [...settled], begun, choices }));
};
const takeUp = async ({ renamed, reading, modes, settled, begun, choices }) => {
  Object.assign(state, { renamed, reading, modes, settled: new Set(settled) });
  for (const [id, value] of choices) byId(id)[typeof value === "boolean" ? "checked" : "value"] = value;
  byId("material").dispatchEvent(new Event("change"));
  for (const [task, { number, values }] of Object.entries(begun)) {
    byId(`${task}-progress`).closest("details")?.setAttribute("open", "");
    await beginShown(task, values, number);
  }
  await inspect();
};

const start = safely(async () => {
  let prepared;
  state.prepared = new Promise(resolve => { prepared = resolve; });  // files chosen before wait for it
  const drop = byId("drop"), pick = byId("pick"), choose = () => { upload([...pick.files]); pick.value = ""; };
  pick.addEventListener("change", choose);
  for (const kind of ["dragenter", "dragover"]) addEventListener(kind, event => { event.preventDefault(); drop.classList.add("over"); });
  addEventListener("dragleave", event => { if (!event.relatedTarget) drop.classList.remove("over"); });
  addEventListener("drop", event => { event.preventDefault(); drop.classList.remove("over"); upload([...event.dataTransfer.files]); });
  if (pick.files.length) choose();  // chosen before this was loaded
  const kept = JSON.parse(sessionStorage.getItem(KEPT)), again = await request(`sessions?again=${kept?.session ?? ""}`, { method: "POST" });
  Object.assign(state, again);
  const news = new EventSource(own("news"));
  news.addEventListener("message", hear);
  news.addEventListener("error", () => { if (news.readyState === EventSource.CLOSED) alertOf("tissuq has ended, or this page was away for too long. Start 'tissuq app' again, or load the page again."); });
  addEventListener("pagehide", keep);
  showChoices(await new Promise((resolve, reject) => {
    begin("choices", {}, (kind, data) => { if (kind === "done") resolve(data); else if (kind === "error") reject(new Error(data.text)); }).catch(reject);
  }));
  if (kept?.session === again.session) await takeUp(kept);
  else if (kept?.files.length) alertOf("This page was away for too long, and its files are deleted. Choose them again.");
  prepared();
  byId("fit-form").addEventListener("submit", fit);
  byId("fit-form").addEventListener("change", changedSince);
  byId("laws-form").addEventListener("submit", compare);
  byId("predict-form").addEventListener("submit", predict);
  byId("export-form").addEventListener("submit", exportCards);
  byId("reading").addEventListener("submit", event => event.preventDefault());
  document.body.dataset.ready = "true";
});
start();
