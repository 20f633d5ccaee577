// SPDX-License-Identifier: BSD-3-Clause
// For the keyboard and readers of screens, which the theme leaves out: what is wider than its
// column scrolls by keys, groups of pages are headings of a level, and both drawers have a name.
document.addEventListener("DOMContentLoaded", () => {
  const all = (selector, change) => document.querySelectorAll(selector).forEach(change);
  all("pre, .table-wrapper, .formula", (each) => { each.tabIndex = 0; });
  all("p.caption[role=heading]", (each) => { each.ariaLevel = "2"; });
  all(".sidebar-drawer", (each) => { each.ariaLabel = "All pages"; });
  all(".toc-drawer", (each) => { each.ariaLabel = "On this page"; });
});
