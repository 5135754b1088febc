// Every word of the tab photograph.
export const photographTexts = {
  title: "Photograph",
};
