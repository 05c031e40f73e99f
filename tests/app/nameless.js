// What can be used and has no name for those who do not see it.
() => [...document.querySelectorAll("button, select, input, a, summary, [role=region], svg.plot, iframe")]
  .filter(item => !item.labels?.length && !item.getAttribute("aria-label") && !item.title && !item.textContent.trim())
  .map(item => item.outerHTML.slice(0, 120))
