// Counts what a page allocates on the GPU by intercepting its WebGL calls: injected before the page's own scripts
// (`page.addInitScript(countGpuMemory)`), so that it is independent of the page's own statistics.

export interface GpuMemory {
  bytes: number; // of the live textures, renderbuffers and buffers
  maximum: number; // maximum so far
}

export function countGpuMemory(): void {
  const memory: GpuMemory = { bytes: 0, maximum: 0 };
  Object.assign(window, { gpuMemory: memory });
  const sizes = new WeakMap<object, number>();
  const note = (object: object | null, bytes: number) => {
    if (!object) return;
    memory.bytes += bytes - (sizes.get(object) ?? 0);
    memory.maximum = Math.max(memory.maximum, memory.bytes);
    sizes.set(object, bytes);
  };
  const gl = WebGL2RenderingContext.prototype;
  const perTexel = new Map<number, number>([
    [gl.R8, 1], [gl.RG8, 2], [gl.RGB8, 3], [gl.RGBA8, 4], [gl.SRGB8_ALPHA8, 4], [gl.R16F, 2], [gl.RGBA16F, 8], [gl.R32F, 4],
    [gl.RGBA32F, 16], [gl.R11F_G11F_B10F, 4], [gl.RGB10_A2, 4], [gl.R32UI, 4], [gl.R32I, 4], [gl.RG32UI, 8], [gl.RGBA32UI, 16], [gl.RGBA8UI, 4],
    [gl.DEPTH_COMPONENT16, 2], [gl.DEPTH_COMPONENT24, 4], [gl.DEPTH_COMPONENT32F, 4], [gl.DEPTH24_STENCIL8, 4],
    [gl.DEPTH32F_STENCIL8, 8], [gl.RGBA, 4], [gl.RGB, 3], [gl.LUMINANCE, 1], [gl.RED, 1], [0x8dbb, 0.5], [0x8dbd, 1], // the last two: BC4 and BC5
  ]);
  const countTextureBytes = (format: number, ...edges: number[]) => {
    const bytes = perTexel.get(format);
    if (bytes === undefined) throw new Error(`a format that is not counted: ${format}`);
    return edges.reduce((product, edge) => product * edge, bytes);
  };
  const bindings: Record<number, number> = {
    [gl.TEXTURE_2D]: gl.TEXTURE_BINDING_2D, [gl.TEXTURE_3D]: gl.TEXTURE_BINDING_3D,
    [gl.TEXTURE_2D_ARRAY]: gl.TEXTURE_BINDING_2D_ARRAY, [gl.TEXTURE_CUBE_MAP]: gl.TEXTURE_BINDING_CUBE_MAP,
    [gl.ARRAY_BUFFER]: gl.ARRAY_BUFFER_BINDING, [gl.ELEMENT_ARRAY_BUFFER]: gl.ELEMENT_ARRAY_BUFFER_BINDING,
    [gl.UNIFORM_BUFFER]: gl.UNIFORM_BUFFER_BINDING, [gl.RENDERBUFFER]: gl.RENDERBUFFER_BINDING,
    [gl.PIXEL_PACK_BUFFER]: gl.PIXEL_PACK_BUFFER_BINDING, [gl.PIXEL_UNPACK_BUFFER]: gl.PIXEL_UNPACK_BUFFER_BINDING,
  };
  const isFace = (target: number) => target >= gl.TEXTURE_CUBE_MAP_POSITIVE_X && target <= gl.TEXTURE_CUBE_MAP_NEGATIVE_Z;
  const hook = (name: string, count: (context: WebGL2RenderingContext, words: any[]) => void) => {
    const methods = gl as unknown as Record<string, (...words: unknown[]) => unknown>;
    const original = methods[name];
    methods[name] = function (this: WebGL2RenderingContext, ...words: unknown[]) {
      count(this, words);
      return original.apply(this, words);
    };
  };
  const bound = (context: WebGL2RenderingContext, target: number) =>
    context.getParameter(bindings[isFace(target) ? gl.TEXTURE_CUBE_MAP : target]) as object | null;
  // Mip levels would add at most a third, and nothing here has any; only the first level counts.
  hook('texStorage2D', (context, [target, , format, width, height]) =>
    note(bound(context, target), countTextureBytes(format, width, height, target === gl.TEXTURE_CUBE_MAP ? 6 : 1)));
  hook('texStorage3D', (context, [target, , format, width, height, depth]) =>
    note(bound(context, target), countTextureBytes(format, width, height, depth)));
  hook('texImage2D', (context, words) => {
    const [target, level, format, width, height] = words;
    if (level !== 0 || words.length < 9) return;
    note(bound(context, target), countTextureBytes(format, width, height, isFace(target) ? 6 : 1));
  });
  hook('texImage3D', (context, [target, level, format, width, height, depth]) => {
    if (level === 0) note(bound(context, target), countTextureBytes(format, width, height, depth));
  });
  hook('renderbufferStorage', (context, [target, format, width, height]) =>
    note(bound(context, target), countTextureBytes(format, width, height)));
  hook('renderbufferStorageMultisample', (context, [target, samples, format, width, height]) =>
    note(bound(context, target), countTextureBytes(format, width, height, samples)));
  hook('bufferData', (context, [target, data]) =>
    note(bound(context, target), typeof data === 'number' ? data : (data as ArrayBufferView).byteLength));
  for (const name of ['deleteTexture', 'deleteRenderbuffer', 'deleteBuffer']) {
    hook(name, (_, [object]) => note(object as object | null, 0));
  }
}
