// Prints a document of the program in place of the page: its body as it is, in the page's style for print.

/** How long pictures may take to be there, ms. */
const PATIENCE_MS = 10_000;

export async function printDocument(html: string) {
  const { body, title } = new DOMParser().parseFromString(html, "text/html");
  const sheet = document.createElement("article");
  sheet.className = "printed";
  sheet.append(...body.childNodes);
  const pictures = [...sheet.querySelectorAll("image")].map((image) => new Promise((done) => {
    image.addEventListener("load", done, { once: true });
    setTimeout(done, PATIENCE_MS);
  }));
  document.querySelector(".printed")?.remove();
  document.body.append(sheet);
  await Promise.all(pictures);
  const before = document.title;
  addEventListener("afterprint", () => {
    document.title = before;
    sheet.remove();
  }, { once: true });
  // It names the file of a PDF.
  document.title = title;
  print();
}
