// What touches the simulated detector, and what is wrong with it.

const FAULTS = [
  ["", "none"], ["open:3", "wire 3 broken"], ["short:2,7", "wires 2 and 7 touch"], ["swap:1,5", "wires 1 and 5 exchanged"],
  ["gain:4:0.8", "channel 4 reads 20 % low"], ["invert:4", "channel 4 inverted"], ["uneven:0.2", "uneven foam"],
  ["driving-sheet:100", "driving layer of 100 ohm/sq"], ["leak:0.01", "layers touch lightly everywhere"],
  ["creep:0.2:3", "foam creeps"], ["hysteresis:0.1", "foam with hysteresis"], ["drift:0.2:600", "conductivity drifts"],
];
/** Whether a fault names no electrode. */
const namesNone = ([text]) => !/^(open|short|swap|gain|invert)/.test(text);
const WISH_STAYS_MS = 500;

// A scene that was made for another detector is scaled to this one, and says so.
function sceneOption(name, madeFor) {
  const option = new Option(name.replaceAll("-", " "), name);
  if (madeFor) {
    option.text += " (other sensor)";
    option.title = `Made for ${madeFor}, and scaled to this detector: to see it on its own, tactomo live --simulate --scene ${name}`;
  }
  return option;
}

/** The choice of scene and fault; asks through `send`. */
export class Simulation {
  constructor({ scenes, detector, electrodes }, send) {
    this.box = document.getElementById("simulation");
    this.scene = document.getElementById("scene");
    this.fault = document.getElementById("fault");
    this.asked = -Infinity;
    const option = ({ name, detector: own }) => sceneOption(name, own && own !== detector ? own : null);
    const demonstrations = document.createElement("optgroup");
    demonstrations.label = "Demonstrations";
    demonstrations.append(...scenes.filter(({ detector: own }) => own).map(option));
    this.scene.replaceChildren(...scenes.filter(({ detector: own }) => !own).map(option), demonstrations);
    // The faults of the list name electrodes up to 7.
    const faults = electrodes.length > 7 ? FAULTS : FAULTS.filter(namesNone);
    this.fault.replaceChildren(...faults.map(([text, words]) => new Option(words, text)));
    const ask = (request) => {
      this.asked = performance.now();
      send(request);
    };
    this.scene.onchange = () => ask({ scene: this.scene.value });
    this.fault.onchange = () => ask({ faults: this.fault.value ? this.fault.value.split(" ") : [] });
  }

  /** Shows a status message. */
  show({ playing }) {
    this.box.hidden = playing.kind !== "simulated";
    if (this.box.hidden || performance.now() - this.asked < WISH_STAYS_MS) return;
    if (this.scene.value !== playing.scene) this.scene.value = playing.scene;
    this.scene.title = this.scene.selectedOptions[0]?.title ?? "";
    // Faults of the command line may be none of the list.
    const text = playing.faults.join(" ");
    if (this.fault.value === text) return;
    if (![...this.fault.options].some(({ value }) => value === text)) this.fault.add(new Option(text, text));
    this.fault.value = text;
  }
}
