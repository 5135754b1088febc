// Every word of the tab whisker.
export const whiskerTexts = {
  title: "Whisker",
};
