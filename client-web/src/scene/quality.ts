// What the machine can be asked to draw. Without a graphics card the processor does it, and every pixel is dear.

/** `fine`: all there is. `plain`: no smoothed edges, no grain, simpler light. */
export type Quality = "fine" | "plain";

/** How renderers that run on the processor name themselves. */
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

/**
 * A drawing context for the canvas, and the quality that suits the machine unless one is asked for. Throws when the
 * browser has none.
 */
export function contextOf(
  canvas: HTMLCanvasElement,
  wanted: Quality | undefined,
): { context: WebGL2RenderingContext; quality: Quality } {
  const quality = wanted ?? (processorDraws() ? "plain" : "fine");
  const context = canvas.getContext("webgl2", { powerPreference: "high-performance", alpha: false, antialias: quality === "fine" });
  if (context === null) throw new Error("this browser draws no WebGL 2");
  return { context, quality };
}

let known: boolean | undefined;

/**
 * Whether pictures are drawn by the processor, for want of a graphics card. Asks a context of its own: whether edges
 * are smoothed has to be said when the real one is made.
 */
export function processorDraws(): boolean {
  known ??= askRenderer();
  return known;
}

function askRenderer(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2");
  if (probe === null) return true;
  const details = probe.getExtension("WEBGL_debug_renderer_info");
  const name: unknown = probe.getParameter(details === null ? probe.RENDERER : details.UNMASKED_RENDERER_WEBGL);
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(String(name));
}
