// Limits on the size of a content: those of the GPU, and those on what an untrusted file may claim.

export interface TextureLimits {
  edge2D: number; // texels along an edge of a layer; WebGL 2 guarantees 2048
  edge3D: number; // texels along an edge of a 3D texture; WebGL 2 guarantees 256
  layers: number; // layers of an array texture; WebGL 2 guarantees 256
  uniformBytes: number; // bytes of a uniform block; WebGL 2 guarantees 16384
  blockTextures: boolean; // whether the GPU samples textures in BC4 and BC5; WebGL 2 does not guarantee it
}

export const kDeclaredLimits: TextureLimits = { edge2D: 2048, edge3D: 256, layers: 256, uniformBytes: 16384, blockTextures: false };

export interface ContentLimits extends TextureLimits {
  fileBytes: number;
  jsonBytes: number;
  bytes: number; // bytes of all textures
  parts: number;
}

export const kContentLimits: ContentLimits = {
  ...kDeclaredLimits, fileBytes: 2 ** 30, jsonBytes: 2 ** 23, bytes: 2 ** 30, parts: 1024,
};
