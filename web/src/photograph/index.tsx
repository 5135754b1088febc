// The tab Photograph.
import { photographTexts } from "../texts/photograph";

export function Photograph() {
  return <div class="nothing"><h1>{photographTexts.title}</h1></div>;
}
