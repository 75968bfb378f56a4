// Words on the page.

/** Writes them where others stand: what is not changed needs not be laid out again. */
export function write(element, words) {
  if (element.textContent !== words) element.textContent = words;
}
