// The choice of the solver.

// A wish is shown this long before the program has answered it.
const WISH_STAYS_MS = 400;

// What each is for, in a few words: the list is read by people who know none of the names.
const PURPOSE = {
  auto: "contacts, shape or image, as needed", contacts: "fingers and points", core: "three points, as on a board",
  nonlinear: "any shape, most exact",
  tikhonov: "quick image, any shape", "tikhonov-paper": "as in the paper", tsvd: "quick image, smoothest", noser: "quick image, even",
  laplace: "quick image, smooth", nonnegative: "image, never negative", tv: "image with sharp edges", bsbl: "image of few patches",
  kernel: "one contact, learned", network: "learned, uncalibrated",
};

/** The select of solvers; calls `ask(request)` when another is chosen. */
export class MethodSelect {
  constructor(solvers, ask) {
    this.solvers = solvers;
    this.select = document.getElementById("method");
    this.select.replaceChildren(...solvers.map(({ name, explanation }) => {
      const option = new Option(name in PURPOSE ? `${name}: ${PURPOSE[name]}` : name, name);
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

  /** Shows which solver is in use and what becomes of the wish for another; says whether it is another than before. */
  show(state, live) {
    const before = this.inUse;
    this.inUse = state?.name;
    this.select.disabled = !state || !live;
    if (!state) return false;
    const { name, making, refused } = state;
    if (performance.now() - this.asked > WISH_STAYS_MS) this.select.value = making ?? name;
    this.select.title = this.explanation;
    this.select.classList.toggle("busy", Boolean(making));
    Object.assign(document.documentElement.dataset, { solver: name, making: making ?? "", refused: refused ?? "" });
    return before !== undefined && before !== name;
  }
}
