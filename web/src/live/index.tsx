// The tab Live.
import { liveTexts } from "../texts/live";

export function Live() {
  return <div class="nothing"><h1>{liveTexts.title}</h1></div>;
}
