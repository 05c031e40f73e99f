// Drops a file with a text on the page.
text => {
  const dropped = new DataTransfer();
  dropped.items.add(new File([text], "../kidney.csv"));
  document.getElementById("drop").dispatchEvent(new DragEvent("drop", { dataTransfer: dropped, bubbles: true }));
}
