// The tab Whisker.
import { whiskerTexts } from "../texts/whisker";

export function Whisker() {
  return <div class="nothing"><h1>{whiskerTexts.title}</h1></div>;
}
