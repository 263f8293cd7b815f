const box = document.querySelector("dialog");
for (const button of document.querySelectorAll("figure button")) {
  button.addEventListener("click", () => {
    const image = button.querySelector("img");
    const large = box.querySelector("img");
    large.src = image.src;
    large.alt = image.alt;
    large.style.width = `min(96vw, ${2 * image.naturalWidth}px)`;
    box.showModal();
  });
}
box.addEventListener("click", () => box.close());
