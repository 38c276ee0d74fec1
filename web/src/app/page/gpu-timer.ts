// How long the graphics card draws, where the browser tells (EXT_disjoint_timer_query_webgl2); some frames late.
import type * as THREE from 'three';

interface Timer {
  readonly TIME_ELAPSED_EXT: number;
  readonly GPU_DISJOINT_EXT: number;
}

export class GpuTimer {
  milliseconds?: number; // of the last picture that is known
  private readonly gl: WebGL2RenderingContext;
  private running?: WebGLQuery;

  constructor(renderer: THREE.WebGLRenderer) {
    this.gl = renderer.getContext() as WebGL2RenderingContext;
  }

  // One picture at a time is measured.
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
    const isLost = !gl.isQuery(running); // of a context that is gone
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
