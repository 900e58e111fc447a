// Runs before anything else of the page. A file of its own: the page allows no inline script.

// So that a dark page never flashes white.
(() => {
  let wanted = null;
  try {
    wanted = localStorage.getItem("mantine-color-scheme-value");
  } catch {
    // Storage can be switched off; the system's own preference then decides.
  }
  const dark = wanted === "dark" || (wanted !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.dataset.mantineColorScheme = dark ? "dark" : "light";
})();

// So that a page of charts has their library when it has their figures.
(() => {
  const { charts } = document.currentScript.dataset;
  if (!charts || !/^\/(campaigns|compare|controller|fly)(\/|$)/.test(location.pathname)) return;
  const link = Object.assign(document.createElement("link"), { rel: "modulepreload", href: charts, crossOrigin: "" });
  document.head.append(link);
})();
