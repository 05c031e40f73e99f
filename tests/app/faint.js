// Texts whose contrast with what is behind them is below 4.5 (WCAG 2.2, 1.4.3).
() => {
  const numbers = color => color.match(/[\d.]+/g).map(Number);
  const linear = share => share <= 0.03928 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * linear(r / 255) + 0.7152 * linear(g / 255) + 0.0722 * linear(b / 255);
  const behind = item => {
    for (let at = item; at; at = at.parentElement) {
      const color = numbers(getComputedStyle(at).backgroundColor);
      if (color.length < 4 || color[3] > 0) return color;
    }
    return [255, 255, 255];
  };
  const hasText = item => [...item.childNodes].some(node => node.nodeType === 3 && node.textContent.trim());
  return [...document.querySelectorAll("body *")]
    .filter(item => item.checkVisibility() && !item.closest("svg, :disabled") && hasText(item))
    .map(item => {
      const shades = [light(numbers(getComputedStyle(item).color)), light(behind(item))];
      return [(Math.max(...shades) + 0.05) / (Math.min(...shades) + 0.05), item.textContent.trim().slice(0, 60)];
    })
    .filter(([contrast]) => contrast < 4.5);
}
