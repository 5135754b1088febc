// A drawing that is kept while it would look the same: as other things move, its pixels are copied and its curves are not drawn again.

export class Layer {
  private canvas: OffscreenCanvas | null = null;
  private shown: readonly unknown[] = [];

  /** Draws over a canvas what `looks` holds: where each of it is the very thing that was drawn last, it looks alike. */
  draw(context: CanvasRenderingContext2D, looks: readonly unknown[], draw: (context: OffscreenCanvasRenderingContext2D) => void) {
    const { width, height } = context.canvas;
    const ratio = context.getTransform().a;
    const now = [width, height, ratio, ...looks];
    if (now.length !== this.shown.length || now.some((one, i) => !Object.is(one, this.shown[i]))) {
      this.canvas ??= new OffscreenCanvas(width, height);
      // This clears it too.
      [this.canvas.width, this.canvas.height] = [width, height];
      const pen = this.canvas.getContext("2d");
      if (!pen) return;
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      draw(pen);
      this.shown = now;
    }
    context.save();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.globalAlpha = 1;
    context.drawImage(this.canvas!, 0, 0);
    context.restore();
  }
}
