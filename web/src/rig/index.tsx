// The tab Rig.
import { rigTexts } from "../texts/rig";

export function Rig() {
  return <div class="nothing"><h1>{rigTexts.title}</h1></div>;
}
