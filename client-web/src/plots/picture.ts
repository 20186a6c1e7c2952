// Strip charts as one picture: what is on the screen, with what stands over it as text.

export interface PictureStrip {
  readonly title: string;
  readonly unit: string;
  readonly curves: readonly { readonly label: string; readonly colour: string }[];
  readonly canvas: HTMLCanvasElement;
}

const HEAD_PX = 22;
const TITLE_PX = 26;
const GAP_PX = 12;
const FONT = "system-ui, sans-serif";

/** Side by side under a line of text, in the colours that the element has now. */
export function pictureOf(strips: readonly PictureStrip[], title: string, element: Element): Promise<Blob | undefined> {
  const scale = devicePixelRatio;
  const style = getComputedStyle(element);
  const colour = (property: string): string => style.getPropertyValue(property).trim();
  const widths = strips.map(({ canvas }) => canvas.width / scale);
  const canvas = document.createElement("canvas");
  canvas.width = Math.ceil((widths.reduce((sum, width) => sum + width + GAP_PX, GAP_PX)) * scale);
  canvas.height = Math.ceil((Math.max(...strips.map((strip) => strip.canvas.height / scale)) + TITLE_PX + HEAD_PX + GAP_PX) * scale);
  const pen = canvas.getContext("2d");
  if (pen === null) return Promise.resolve(undefined);
  pen.scale(scale, scale);
  pen.fillStyle = colour("--panel");
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.textBaseline = "middle";
  pen.font = `12px ${FONT}`;
  pen.fillStyle = colour("--text-soft");
  pen.fillText(title, GAP_PX, GAP_PX / 2 + TITLE_PX / 2);
  let left = GAP_PX;
  for (const [n, strip] of strips.entries()) {
    let x = left;
    const write = (text: string, font: string, property: string): void => {
      pen.font = font;
      pen.fillStyle = colour(property);
      pen.fillText(text, x, TITLE_PX + HEAD_PX / 2);
      x += pen.measureText(text).width + 8;
    };
    write(strip.title, `bold 13px ${FONT}`, "--text");
    write(strip.unit, `13px ${FONT}`, "--text-faint");
    for (const curve of strip.curves) write(curve.label, `12px ${FONT}`, curve.colour);
    pen.drawImage(strip.canvas, left, TITLE_PX + HEAD_PX, widths[n], strip.canvas.height / scale);
    left += widths[n] + GAP_PX;
  }
  return new Promise((resume) => canvas.toBlob((blob) => resume(blob ?? undefined), "image/png"));
}
