// The address of a page that is shared on the network, as a picture for the camera of a phone.

/** Offers it, if there is one. */
export function offerAddress({ shared }) {
  const button = document.getElementById("share");
  button.hidden = !shared;
  if (!shared) return;
  document.getElementById("shared-address").textContent = shared;
  button.onclick = () => {
    document.getElementById("shared-code").src = "address.svg";
    document.getElementById("shared").showModal();
  };
}
