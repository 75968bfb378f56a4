// Light or dark: as the system says, until the person chooses.

const dark = window.matchMedia("(prefers-color-scheme: dark)");
const stored = () => localStorage.getItem("theme");

/** The theme of now, `light` or `dark`. */
export const theme = () => stored() ?? (dark.matches ? "dark" : "light");

/** Makes the button switch, and calls `onChange(theme)` whenever the theme changes. */
export function listenForTheme(onChange) {
  const apply = () => {
    document.documentElement.dataset.theme = theme();
    onChange(theme());
  };
  dark.addEventListener("change", apply);
  document.getElementById("theme").onclick = () => {
    localStorage.setItem("theme", theme() === "dark" ? "light" : "dark");
    apply();
  };
  apply();
}
