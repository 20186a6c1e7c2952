// The Live page: the clay being cut, when it was cut, what hand and tool do, how the connection is, and every control.

import type { JSX } from "preact";
import { ClayPanel } from "./clay_panel";
import { Controls } from "./controls";
import { OperatePanel } from "./operate/operate_panel";
import { PlotsPanel } from "./plots_panel";
import { QualityPanel } from "./quality_panel";
import { TimeLine } from "./time_line";

export function LivePage(): JSX.Element {
  return (
    <div class="live">
      <ClayPanel />
      <TimeLine />
      <PlotsPanel />
      <QualityPanel />
      <div class="side">
        <OperatePanel />
        <Controls />
      </div>
    </div>
  );
}
