// Returns the frame rate as text. For the first frame after a rest it is unknown, as the time since the last animation
// frame is not its duration.

export class FrameRate {
  private isDrawing = false; // a frame was drawn in the last animation frame
  private awaited = 0; // id of the requested animation frame

  constructor(private readonly say: (text: string) => void) {}

  // Is called when a frame is drawn, with the time since the last animation frame.
  drew(milliseconds: number): void {
    if (this.isDrawing) this.say(`${inDigits(milliseconds)} ms, ${inDigits(1000 / milliseconds)} fps`);
    this.isDrawing = true;
    cancelAnimationFrame(this.awaited);
    // The next animation frame may begin here before anything is drawn in it; the one after it ends the measurement.
    this.awaited = requestAnimationFrame(() => (this.awaited = requestAnimationFrame(() => this.rest())));
  }

  rest(): void {
    cancelAnimationFrame(this.awaited);
    this.isDrawing = false;
    this.say('at rest');
  }
}

export function inDigits(x: number): string {
  return x.toFixed(x < 10 ? 1 : 0);
}
