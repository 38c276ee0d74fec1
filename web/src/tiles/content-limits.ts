// How much a content may be: of what the graphics card takes, and of what a file from outside may claim.

export interface TextureLimits {
  edge2D: number; // texels along an edge of a layer; WebGL2 promises 2048
  edge3D: number; // texels along an edge of a texture of three dimensions; WebGL2 promises 256
  layers: number; // of an array; 256
  uniformBytes: number; // of a block of uniforms; 16384
}

export const kPromisedLimits: TextureLimits = { edge2D: 2048, edge3D: 256, layers: 256, uniformBytes: 16384 };

export interface ContentLimits extends TextureLimits {
  fileBytes: number;
  jsonBytes: number;
  bytes: number; // of textures
  parts: number;
}

export const kContentLimits: ContentLimits = {
  ...kPromisedLimits, fileBytes: 2 ** 30, jsonBytes: 2 ** 23, bytes: 2 ** 30, parts: 1024,
};
