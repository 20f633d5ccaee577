// What every page does: colours, and wide tables within reach of the keyboard.
"use strict";

(function () {
  const theme = document.getElementById("theme");
  theme.addEventListener("change", () => { document.documentElement.dataset.theme = theme.value; });

  // Wide tables scroll within themselves; the keyboard must reach them then.
  function reachable() {
    for (const box of document.querySelectorAll(".scroll"))
      if (box.scrollWidth > box.clientWidth) box.tabIndex = 0; else box.removeAttribute("tabindex");
  }
  addEventListener("resize", reachable);

  document.querySelector("header .settings").hidden = false;
  reachable();
})();
