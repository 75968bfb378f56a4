// What is told of what touches: one answer, drawn whole. Headline, table, totals and labels are always those of the same update, and the picture shows
// no other than they tell.

import { headlineOf } from "./headline.js";
import { valueOf } from "./strength.js";
import { HeldPrefix } from "./units.js";

/** An answer is told for so long at least: what changes faster cannot be read. */
export const STAYS_MS = 200;

// What an update says, but for its numbers: where that is as in the update that is told, the picture may go on.
function saidBy(update) {
  const { contacts, excluded, exchanged, shape } = update;
  return JSON.stringify([shape ? shape.kind : headlineOf(update), contacts.map(({ id }) => id).sort(), excluded, exchanged, update.flags.includes("misfit")]);
}

/** The update that is told. */
export class Told {
  update = null;
  since = -Infinity;
  said = "";
  prefixes = new Map();

  /** What becomes of the newest update: it is `told` from now on, only `drawn`, for it says what is told, or `held`, for it says something else too soon. */
  take(update, now) {
    const said = saidBy(update);
    if (now - this.since < STAYS_MS) return said === this.said ? "drawn" : "held";
    Object.assign(this, { update, said, since: now });
    this.#holdPrefixes(now);
    return "told";
  }

  /** Time until another may be told (ms). */
  left(now) { return Math.max(0, this.since + STAYS_MS - now); }

  /** A sum that is told by itself, with the unit that it is to be told in. */
  totalOf(total, now) {
    if (total) this.#hold("total", total, now, this.prefixes);
    return total;
  }

  /** The contact whose numbers are told of a contact; one that has just come, or has no number, tells its own. */
  contactOf(contact) {
    return this.update?.contacts.find(({ id }) => id && id === contact.id) ?? contact;
  }

  /** The same of a shape. */
  shapeOf(shape) {
    return this.update?.shape?.kind === shape.kind ? this.update.shape : shape;
  }

  // Numbers of the same thing keep their unit for a while.
  #holdPrefixes(now) {
    const { contacts, shape, total } = this.update;
    const before = this.prefixes;
    this.prefixes = new Map();
    const all = [...contacts.filter(({ id }) => id).map((contact) => [contact.id, contact]), ["shape", shape], ["total", total]];
    for (const [key, of] of all) if (of) this.#hold(key, of, now, before);
  }

  #hold(key, of, now, before) {
    const value = valueOf(of);
    if (value === null) return;
    const held = before.get(key) ?? new HeldPrefix();
    this.prefixes.set(key, held);
    of.prefix = held.of(value, now);
  }
}
