// What stands on a page, and the search. Both work without a network, also from file:// addresses.

function tableOfContents(list) {
  for (const heading of document.querySelectorAll("main h2, main h3")) {
    const section = heading.closest("[id]");
    if (!section) continue;
    const link = document.createElement("a");
    link.href = "#" + section.id;
    link.textContent = heading.textContent.trim();
    link.className = "nav-link " + (heading.tagName === "H3" ? "ms-3 py-0" : "py-1");
    list.append(link);
  }
}

// The places with every word of the question: first those that have one in their heading.
function matches(question) {
  const words = question.toLowerCase().split(/\s+/).filter(Boolean);
  const score = (place) => {
    const heading = (place.what + " " + place.title).toLowerCase();
    const all = heading + " " + (place.text + " " + place.code).toLowerCase();
    if (!words.every((word) => all.includes(word))) return 0;
    return 1 + words.filter((word) => heading.includes(word)).length;
  };
  return searchPlaces
    .map((place) => ({ place, score: score(place) }))
    .filter((found) => found.score > 0)
    .sort((a, b) => b.score - a.score)
    .slice(0, 12)
    .map((found) => found.place);
}

function search(input) {
  const root = input.dataset.searchIndex.replace(/search[.]json$/, "");
  const list = document.createElement("div");
  list.className = "list-group position-absolute shadow search-results";
  input.parentElement.classList.add("position-relative");
  input.parentElement.append(list);
  input.addEventListener("input", () => {
    list.replaceChildren();
    if (input.value.trim().length < 2) return;
    for (const place of matches(input.value)) {
      const link = document.createElement("a");
      link.className = "list-group-item list-group-item-action";
      link.href = root + place.path.replace(/^\//, "") + (place.id ? "#" + place.id : "");
      link.textContent = place.title + (place.what === place.title ? "" : ": " + place.what);
      list.append(link);
    }
    if (!list.children.length) list.textContent = "Nothing was found.";
  });
  input.form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (list.firstElementChild) location.href = list.firstElementChild.href;
  });
}

document.addEventListener("DOMContentLoaded", () => {
  const toc = document.getElementById("toc");
  if (toc) tableOfContents(toc);
  const input = document.getElementById("search-input");
  if (input) search(input);
});
