// What the readers of every representation's contents have in common: untrusted bytes. docs/tile-format.md, sections 5 and 10.
import { SceneError } from '../scene-error';
import type { ContentLimits } from './content-limits';
import { decodeGlb } from './glb';
import { arrayOf, fieldOf, stringOf, wholeFrom, wholeOf, type Json } from './json-fields';
import { DecoderFailure, decodeLossless } from './lossless-image';
import { kMostLayers, kMostLayerWidth, type DenseLayer } from './network';

export const kContentVersion = 1;
const kExtension = 'TESSERA_content';
const kMostViews = 65536;

// What a file says: its extension, and its buffer views, which are views of the file.
export interface ContentFile {
  ours: Json;
  views: Uint8Array[];
}

// The view that an object names, if its mimeType is this one.
export function viewOf(views: Uint8Array[], source: Json, mimeType: string): Uint8Array | undefined {
  const index = wholeOf(source, 'bufferView');
  return index !== undefined && stringOf(source, 'mimeType') === mimeType ? views[index] : undefined;
}

export class ContentReader {
  // `name` is what errors name.
  constructor(
    protected readonly name: string,
    protected readonly limits: ContentLimits,
  ) {}

  protected fail(reason: string, remedy = 'copy the scene again, or bake it again'): never {
    throw new SceneError(this.name, '', reason, remedy);
  }

  protected readFile(file: Uint8Array, representation: string): ContentFile {
    if (file.length > this.limits.fileBytes) this.fail('is larger than any content should be');
    const glb = decodeGlb(file) ?? this.fail('is no binary glTF 2.0 file');
    if (glb.json.length > this.limits.jsonBytes) this.fail("its JSON is larger than any content's should be");
    let asset: Json;
    try {
      asset = JSON.parse(new TextDecoder().decode(glb.json));
    } catch {
      this.fail('its JSON is none');
    }
    return { ours: this.readAsset(asset, representation), views: this.readViews(asset, glb.bytes) };
  }

  protected readNetwork(source: Json, views: Uint8Array[]): DenseLayer[] {
    const layers = arrayOf(source, 'layers') ?? this.fail('has no network');
    const bytes = viewOf(views, source, 'application/octet-stream') ?? this.fail('has no network');
    if (layers.length > kMostLayers) this.fail('the network has too many layers');
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    let at = 0;
    const take = (numbers: number) => {
      if (bytes.length - at < 4 * numbers) this.fail('the network has fewer numbers than its layers need');
      const taken = new Float32Array(numbers);
      for (let i = 0; i < numbers; ++i, at += 4) taken[i] = view.getFloat32(at, true);
      return taken;
    };
    const network = layers.map((sides): DenseLayer => {
      const side = (i: number) => (Array.isArray(sides) && sides.length === 2 ? wholeFrom(sides[i], kMostLayerWidth) : undefined);
      const inputs = side(0) ?? this.fail('a layer of the network is out of bounds');
      const outputs = side(1) ?? this.fail('a layer of the network is out of bounds');
      return { inputs, outputs, weights: take(inputs * outputs), biases: take(outputs) };
    });
    if (at !== bytes.length) this.fail('the network has more numbers than its layers need');
    return network;
  }

  private readAsset(asset: Json, representation: string): Json {
    if (stringOf(fieldOf(asset, 'asset'), 'version') !== '2.0') this.fail('its JSON is not that of a glTF 2.0 asset');
    const ours = fieldOf(fieldOf(asset, 'extensions'), kExtension);
    if (ours === undefined || !arrayOf(asset, 'extensionsUsed')?.includes(kExtension)) {
      this.fail(`has no extension ${kExtension}`);
    }
    const version = wholeOf(ours, 'version') ?? this.fail('does not say which version it is of');
    if (version !== kContentVersion) this.fail(`is of version ${version}; ${kContentVersion} is known`);
    if (stringOf(ours, 'representation') !== representation) this.fail(`is not of the representation ${representation}`);
    return ours;
  }

  private readViews(asset: Json, bytes: Uint8Array): Uint8Array[] {
    const outside = 'its buffer views do not lie within its bytes';
    const buffers = arrayOf(asset, 'buffers') ?? [];
    const length = wholeOf(buffers[0], 'byteLength') ?? -1;
    if (buffers.length !== 1 || fieldOf(buffers[0], 'uri') !== undefined) this.fail(outside);
    if (length < 0 || length > bytes.length || bytes.length - length > 3) this.fail(outside);
    const views = arrayOf(asset, 'bufferViews') ?? this.fail(outside);
    if (views.length > kMostViews) this.fail(outside);
    return views.map((view) => {
      const size = wholeOf(view, 'byteLength');
      const offset = fieldOf(view, 'byteOffset') === undefined ? 0 : wholeOf(view, 'byteOffset');
      if (wholeOf(view, 'buffer') !== 0 || size === undefined || offset === undefined || offset + size > length) {
        this.fail(outside);
      }
      return bytes.subarray(offset, offset + size);
    });
  }

  protected readPicture(views: Uint8Array[], source: Json, { width, height }: { width: number; height: number }): Uint8ClampedArray | undefined {
    const bytes = viewOf(views, source, 'image/webp');
    try {
      return bytes && decodeLossless(bytes, width, height);
    } catch (error) {
      if (!(error instanceof DecoderFailure)) throw error;
      this.fail('is more than the decoder of pictures has memory for', 'close other pages, or copy the scene again');
    }
  }
}
