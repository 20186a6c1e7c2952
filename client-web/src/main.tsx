import { render } from "preact";
import { App } from "./ui/app";
import { loadMathematics } from "./ui/mathematics";
import { followAddress } from "./ui/pages";
import { start } from "./ui/store";
import "./ui/style/theme.css";
import "./ui/style/shell.css";
import "./ui/style/live.css";
import "./ui/style/controls.css";
import "./ui/style/theory.css";
import { followTheme } from "./ui/theme";

followTheme();
followAddress();
start();
void loadMathematics();
const host = document.getElementById("app");
if (host !== null) render(<App />, host);
