// The page: one element, four tabs.
import "./style/tokens.css";
import "./style/base.css";
import "./style/parts.css";
import "./style/photograph.css";
import "./style/printed.css";
import { render } from "preact";
import { Shell } from "./shell";

render(<Shell />, document.getElementById("app")!);
