// The choice of the solver.

// A wish is shown this long before the program has answered it.
const WISH_STAYS_MS = 400;

/** The select of solvers; calls `ask(name)` when another is chosen. */
export class MethodSelect {
  constructor(solvers, ask) {
    this.solvers = solvers;
    this.select = document.getElementById("method");
    this.note = document.getElementById("method-note");
    this.select.replaceChildren(...solvers.map(({ name, explanation }) => {
      const option = new Option(name, name);
      option.title = explanation;
      return option;
    }));
    this.asked = -Infinity;
    this.select.onchange = () => {
      this.asked = performance.now();
      document.documentElement.dataset.making = this.select.value;
      ask({ solver: this.select.value });
    };
  }

  /** What the solver in use is. */
  get explanation() {
    return this.solvers.find(({ name }) => name === this.inUse)?.explanation ?? "";
  }

  /** Shows which solver is in use, and what becomes of the wish for another. */
  show(state, live) {
    this.inUse = state?.name;
    this.select.disabled = !state || !live;
    if (!state) return;
    const { name, making, refused } = state;
    if (performance.now() - this.asked > WISH_STAYS_MS) this.select.value = making ?? name;
    this.select.title = this.explanation;
    this.note.textContent = making ? "getting ready…" : refused ? `cannot be had: ${refused}` : "";
    this.note.title = this.note.textContent;
    this.note.classList.toggle("bad", !making && Boolean(refused));
    Object.assign(document.documentElement.dataset, { solver: name, making: making ?? "", refused: refused ?? "" });
  }
}
