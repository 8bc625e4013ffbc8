// A still becomes the view that it stands for.
addEventListener("click", (event) => {
  const still = event.target.closest("button.view");
  if (!still) return;
  const frame = document.createElement("iframe");
  frame.className = "view";
  frame.style.cssText = still.dataset.style;
  frame.src = still.dataset.view;
  frame.allow = "fullscreen";
  still.replaceWith(frame);
});
