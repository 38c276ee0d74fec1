// The part of the interface of gltf-validator that tests use; the package contains no types.
declare module 'gltf-validator' {
  export interface GltfReport {
    issues: { numErrors: number; numWarnings: number; messages: { code: string; severity: number; message: string }[] };
    info: { drawCallCount: number };
  }
  // `externalResourceFunction` returns the bytes of a file that the asset refers to by `uri`.
  export function validateBytes(
    bytes: Uint8Array,
    options: { externalResourceFunction?: (uri: string) => Promise<Uint8Array> },
  ): Promise<GltfReport>;
}
