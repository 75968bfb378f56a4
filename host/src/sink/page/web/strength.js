// How firmly something presses, as one number that is steady, and as a word.

import { withPrefix } from "./units.js";

/** The apparent conductance: of a firm contact it is known far better than the conductance, which goes up and down with the noise. Null if neither is known. */
export const conductanceOf = ({ apparentS, conductanceS }) => apparentS ?? conductanceS ?? null;

/** Newtons where they are known, else that. */
export const valueOf = (contact) => contact.forceN ?? conductanceOf(contact);

/** The same for people: "or more" where a force is beyond what the detector can tell. */
export function strengthOf(contact) {
  const value = valueOf(contact);
  if (value === null) return "\u2013";
  const { forceN = null, beyondMaximum, prefix } = contact;
  return forceN === null ? withPrefix(value, "S", 3, prefix) : `${beyondMaximum ? "\u2273\u2009" : ""}${withPrefix(value, "N", 3, prefix)}`;
}

// Conductance over the sheet conductance: up to the first a touch is so light that linear theory describes it, from the second on a contact conducts
// nearly as well as the detector about it, and more would change little.
const WORDS = [[0.03, "light"], [0.3, "medium"], [Infinity, "firm"]];
const BAR = { least: 0.003, most: 3 };

/** A share of the sheet conductance as a word. */
export const wordOf = (share) => WORDS.find(([below]) => share < below)[1];

/** The same from 0 to 1, for a bar. */
export const barOf = (share) => Math.min(1, Math.max(0.02, Math.log(Math.max(1e-9, share) / BAR.least) / Math.log(BAR.most / BAR.least)));
