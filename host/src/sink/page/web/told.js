// The numbers that are told of what touches: those of one update for a while, wherever they stand.

// Numbers that change faster cannot be read.
const STAYS_MS = 120;

/** The update whose numbers are told. */
export class Told {
  constructor() {
    this.update = null;
    this.since = -Infinity;
  }

  /** Takes the newest update; whether its numbers are told from now on. */
  take(update, now) {
    if (now - this.since < STAYS_MS) return false;
    [this.update, this.since] = [update, now];
    return true;
  }

  /** The contact whose numbers are told of a contact; one that has just come, or has no number, tells its own. */
  contactOf(contact) {
    return this.update?.contacts.find(({ id }) => id && id === contact.id) ?? contact;
  }

  /** The same of a shape. */
  shapeOf(shape) {
    return this.update?.shape?.kind === shape.kind ? this.update.shape : shape;
  }
}
