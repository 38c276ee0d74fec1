// Drivers that draw on the CPU: Mesa's, those that browsers bring, and Microsoft's.
const kSoftware = /llvmpipe|softpipe|swiftshader|microsoft basic render/i;

// Returns the name of what draws, as far as the browser tells.
export function rendererName(gl: WebGL2RenderingContext): string {
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  return String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}

export function drawsOnCpu(gl: WebGL2RenderingContext): boolean {
  return kSoftware.test(rendererName(gl));
}
