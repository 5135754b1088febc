// Every word of the tab live.
export const liveTexts = {
  title: "Live",
};
