// Every word of the tab rig.
export const rigTexts = {
  title: "Rig",
};
