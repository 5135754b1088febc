// Choices: the view that image and residuals show, what is drawn, how much is magnified.
const views = byId("view");
function addChoice(list, value, text, isChosen) {
  const choice = new Option(text, value, isChosen, isChosen);
  list.add(choice);
}

const rows = new Map([...document.querySelectorAll("tr[data-view]")].map((row) => [Number(row.dataset.view), row]));

function choose(view) {
  const row = rows.get(state.view);
  if (row) row.classList.remove("chosen");
  state.view = Math.min(data.views.length - 1, Math.max(ALL_VIEWS, view));
  views.value = String(state.view);
  const chosen = rows.get(state.view);
  if (chosen) chosen.classList.add("chosen");
  byId("said").textContent = state.view === ALL_VIEWS ? data.views.length + " views" : state.view + 1 + " of " + data.views.length;
  redraw();
}

addChoice(views, ALL_VIEWS, "all", true);
data.views.forEach((name, i) => addChoice(views, i, name, false));
views.addEventListener("change", () => choose(Number(views.value)));
byId("before").addEventListener("click", () => choose(state.view - 1));
byId("after").addEventListener("click", () => choose(state.view + 1));
for (const [view, row] of rows) row.addEventListener("click", () => choose(view));

const magnified = byId("magnified");
for (const factor of [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10]) {
  const value = Number((factor * data.residual_magnification).toPrecision(3));
  addChoice(magnified, value, value + " ×", factor === 1);
}
magnified.addEventListener("change", () => {
  magnification = Number(magnified.value);
  redraw();
});

for (const box of document.querySelectorAll("input[type=checkbox]")) box.addEventListener("change", redraw);
for (const button of document.querySelectorAll("button[data-turn]")) button.addEventListener("click", () => look(button.dataset.turn));
window.addEventListener("resize", redraw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

for (const hidden of document.querySelectorAll("[data-script],#bar,canvas")) hidden.hidden = false;
document.documentElement.classList.add("scripted");
choose(ALL_VIEWS);
