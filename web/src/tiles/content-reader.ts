// The common part of the content readers of all representations. The bytes are untrusted. docs/tile-format.md, sections
// 5 and 10.
import { SceneError } from '../scene-error';
import type { ContentLimits } from './content-limits';
import { decodeGlb } from './glb';
import { getArray, getField, getString, wholeFrom, getInteger, type Json } from './json-fields';
import { DecoderFailure, decodeLossless } from './lossless-image';
import { kMaxLayers, kMaxLayerWidth, type DenseLayer } from './network';

export const kContentVersion = 1;
const kExtension = 'TESSERA_content';
const kMaxViews = 65536;

// The parsed JSON extension of a file, and its buffer views, which are views of the file.
export interface ContentFile {
  ours: Json;
  views: Uint8Array[];
}

// Returns the buffer view that an object references, if its mimeType is the expected one.
export function bufferViewBytes(views: Uint8Array[], source: Json, mimeType: string): Uint8Array | undefined {
  const index = getInteger(source, 'bufferView');
  return index !== undefined && getString(source, 'mimeType') === mimeType ? views[index] : undefined;
}

export class ContentReader {
  // Errors name the file as `name`.
  constructor(
    protected readonly name: string,
    protected readonly limits: ContentLimits,
  ) {}

  protected fail(reason: string, remedy = 'copy the scene again, or bake it again'): never {
    throw new SceneError(this.name, '', reason, remedy);
  }

  // Fails for good: trying again cannot help.
  protected refuse(reason: string, remedy: string): never {
    throw new SceneError(this.name, '', reason, remedy, true);
  }

  protected readFile(file: Uint8Array, representation: string): ContentFile {
    if (file.length > this.limits.fileBytes) this.fail('is larger than any content should be');
    const glb = decodeGlb(file) ?? this.fail('is not a binary glTF 2.0 file, or is cut short');
    if (glb.json.length > this.limits.jsonBytes) this.fail("its JSON is larger than any content's should be");
    let asset: Json;
    try {
      asset = JSON.parse(new TextDecoder().decode(glb.json));
    } catch {
      this.fail('its JSON is not that of a glTF 2.0 asset');
    }
    return { ours: this.readAsset(asset, representation), views: this.readViews(asset, glb.bytes) };
  }

  protected readNetwork(source: Json, views: Uint8Array[]): DenseLayer[] {
    const layers = getArray(source, 'layers') ?? this.fail('has no network');
    const bytes = bufferViewBytes(views, source, 'application/octet-stream') ?? this.fail('has no network');
    if (layers.length > kMaxLayers) this.fail('the network has too many layers');
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    let at = 0;
    const take = (numbers: number) => {
      if (bytes.length - at < 4 * numbers) this.fail('the network has fewer numbers than its layers need');
      const taken = new Float32Array(numbers);
      for (let i = 0; i < numbers; ++i, at += 4) taken[i] = view.getFloat32(at, true);
      return taken;
    };
    const network = layers.map((sides): DenseLayer => {
      const side = (i: number) => (Array.isArray(sides) && sides.length === 2 ? wholeFrom(sides[i], kMaxLayerWidth) : undefined);
      const inputs = side(0) ?? this.fail('a layer of the network is out of bounds');
      const outputs = side(1) ?? this.fail('a layer of the network is out of bounds');
      return { inputs, outputs, weights: take(inputs * outputs), biases: take(outputs) };
    });
    if (at !== bytes.length) this.fail('the network has more numbers than its layers need');
    return network;
  }

  private readAsset(asset: Json, representation: string): Json {
    if (getString(getField(asset, 'asset'), 'version') !== '2.0') this.fail('its JSON is not that of a glTF 2.0 asset');
    const ours = getField(getField(asset, 'extensions'), kExtension);
    if (ours === undefined || !getArray(asset, 'extensionsUsed')?.includes(kExtension)) {
      this.fail(`has no extension ${kExtension}`);
    }
    const version = getInteger(ours, 'version') ?? this.fail('does not state its version');
    if (version !== kContentVersion) this.fail(`has version ${version}; only ${kContentVersion} is supported`);
    if (getString(ours, 'representation') !== representation) this.fail(`is not of the representation ${representation}`);
    return ours;
  }

  private readViews(asset: Json, bytes: Uint8Array): Uint8Array[] {
    const outside = 'its buffer views do not lie within its bytes';
    const buffers = getArray(asset, 'buffers') ?? [];
    const length = getInteger(buffers[0], 'byteLength') ?? -1;
    if (buffers.length !== 1 || getField(buffers[0], 'uri') !== undefined) this.fail(outside);
    if (length < 0 || length > bytes.length || bytes.length - length > 3) this.fail(outside);
    const views = getArray(asset, 'bufferViews') ?? this.fail(outside);
    if (views.length > kMaxViews) this.fail(outside);
    return views.map((view) => {
      const size = getInteger(view, 'byteLength');
      const offset = getField(view, 'byteOffset') === undefined ? 0 : getInteger(view, 'byteOffset');
      if (getInteger(view, 'buffer') !== 0 || size === undefined || offset === undefined || offset + size > length) {
        this.fail(outside);
      }
      return bytes.subarray(offset, offset + size);
    });
  }

  protected readPicture(views: Uint8Array[], source: Json, { width, height }: { width: number; height: number }): Uint8ClampedArray | undefined {
    const bytes = bufferViewBytes(views, source, 'image/webp');
    try {
      return bytes && decodeLossless(bytes, width, height);
    } catch (error) {
      if (!(error instanceof DecoderFailure)) throw error;
      this.fail('is more than the image decoder has memory for', 'close other pages, or copy the scene again');
    }
  }
}
