// Measures the GPU time of frames if the browser supports it (EXT_disjoint_timer_query_webgl2), with a delay of some
// frames.
import type * as THREE from 'three';

interface Timer {
  readonly TIME_ELAPSED_EXT: number;
  readonly GPU_DISJOINT_EXT: number;
}

export class GpuTimer {
  milliseconds?: number; // of the last measured frame
  private readonly gl: WebGL2RenderingContext;
  private running?: WebGLQuery;

  constructor(renderer: THREE.WebGLRenderer) {
    this.gl = renderer.getContext() as WebGL2RenderingContext;
  }

  // One frame is measured at a time.
  measure(draw: () => void): void {
    const { gl } = this;
    const timer = gl.getExtension('EXT_disjoint_timer_query_webgl2') as Timer | null;
    if (!timer || gl.isContextLost() || !this.hasEnded(timer)) return draw();
    const query = gl.createQuery();
    gl.beginQuery(timer.TIME_ELAPSED_EXT, query);
    try {
      draw();
    } finally {
      gl.endQuery(timer.TIME_ELAPSED_EXT);
      this.running = query;
    }
  }

  private hasEnded(timer: Timer): boolean {
    const { gl, running } = this;
    if (!running) return true;
    const isLost = !gl.isQuery(running); // the query belongs to a lost context
    if (!isLost && !gl.getQueryParameter(running, gl.QUERY_RESULT_AVAILABLE)) return false;
    if (!isLost) {
      const isDisjoint = gl.getParameter(timer.GPU_DISJOINT_EXT) as boolean;
      if (!isDisjoint) this.milliseconds = (gl.getQueryParameter(running, gl.QUERY_RESULT) as number) / 1e6;
      gl.deleteQuery(running);
    }
    this.running = undefined;
    return true;
  }
}
