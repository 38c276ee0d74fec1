// The part of the content shader that is specific to `volume` scenes: their march, and their network, which is
// evaluated for each content (docs/tile-format.md, section 6).
import marchSource from '../../../../shaders/representations/volume/volume_march.glsl?raw';
import { layersShader, writtenVector } from '../../draw/network-shader';
import type { ProgramPieces } from '../../raymarch/content-program';
import { atlasShader } from '../../raymarch/content-textures';
import { packNetwork, type DenseLayer } from '../../tiles/network';
import { kVectorsOfPart, vectorsOfVolume, type VolumePart } from './volume-content';
import { kVoxelAtlases } from './volume-textures';

const kUniforms = `
layout(location = 0) out vec4 colourAndOpacity;
uniform sampler2DArray planeTexelsFirst, planeTexelsSecond;
uniform sampler3D macroblocks, distances;
uniform float featureRange, densityRange, stepsPerTexel;
`;

// `content` begins with six vectors per part; its planes occupy the corner of three layers; the numbers in macroblocks
// are places in an atlas, as bytes.
const kParts = `
struct Part {
  Place place;
  float texels;  // of a plane along an axis
  float voxels;  // along an axis
  float layer;   // of its first plane
  ivec3 macroblockOrigin, distanceOrigin;
};

Part fetchPart(int n) {
  vec4 a = content[6 * n], b = content[6 * n + 1], c = content[6 * n + 2], d = content[6 * n + 3];
  ivec3 macroblocks = ivec3(content[6 * n + 4].xyz), distances = ivec3(content[6 * n + 5].xyz);
  return Part(unpackPlace(a, b, c, d), b.w, a.w, d.w, macroblocks, distances);
}

float reachAt(Part part, vec3 cell) {
  return floor(texelFetch(distances, part.distanceOrigin + ivec3(cell), 0).r * 255.0 + 0.5);
}

vec4 macroblockAt(Part part, vec3 block) {
  return texelFetch(macroblocks, part.macroblockOrigin + ivec3(block), 0);
}

vec3 inAtlas(vec4 macroblock, vec3 within) {
  return floor(macroblock.xyz * 255.0 + 0.5) * 9.0 + within + 0.5;
}

vec4 voxelsFirst(Part part, vec4 macroblock, vec3 within) { return voxelAtlasFirst(inAtlas(macroblock, within)); }
vec4 voxelsSecond(Part part, vec4 macroblock, vec3 within) { return voxelAtlasSecond(inAtlas(macroblock, within)); }

vec4 samplePlanes(highp sampler2DArray planes, Part part, vec3 x) {
  vec3 p = clamp(x, 0.5, part.texels - 0.5) / float(textureSize(planes, 0).x);
  return textureLod(planes, vec3(p.yz, part.layer), 0.0) + textureLod(planes, vec3(p.xz, part.layer + 1.0), 0.0) +
    textureLod(planes, vec3(p.xy, part.layer + 2.0), 0.0);
}

vec4 planesFirst(Part part, vec3 x) { return samplePlanes(planeTexelsFirst, part, x); }
vec4 planesSecond(Part part, vec3 x) { return samplePlanes(planeTexelsSecond, part, x); }
`;

const kWrite = `
void writeContent(Composite sum, vec3 d, float opacity, float seen) {
  vec3 specular = deferred(sum.diffuse, sum.features, d);
  vec3 colour = sum.diffuse + opacity * specular;
  if (display == kShowDiffuse) colour = sum.diffuse;
  if (display == kShowSpecular) colour = opacity * specular;
  if (display == kShowFeatures) colour = sum.features.rgb;
  if (display == kShowBlocks || display == kShowLevels) {
    vec3 tint = display == kShowBlocks ? colourOfBlock : colourOfLevel;
    colour = tint * (0.35 * opacity + 0.65 * dot(colour, vec3(0.3, 0.6, 0.1)));
  }
  colourAndOpacity = seen * vec4(colour, opacity);
}`;

// Defines `vec3 deferred(vec3 diffuse, vec4 features, vec3 d)`, using layersShader.
export function deferredShader(network: Pick<DenseLayer, 'inputs' | 'outputs'>[], vector: (n: number) => string): string {
  const harmonics = [1, 2, 3].map((k) =>
    `  vec3 s${k} = 2.0 * s${k - 1} * c${k - 1}, c${k} = 1.0 - 2.0 * s${k - 1} * s${k - 1};`);
  const xyz = (name: string) => ['x', 'y', 'z'].map((axis) => `${name}.${axis}`);
  const inputs = [
    ...xyz('diffuse'), ...xyz('features'), 'features.w', ...xyz('d'),
    ...['s0', 's1', 's2', 's3', 'c0', 'c1', 'c2', 'c3'].flatMap(xyz),
  ];
  const { lines, outputs } = layersShader(inputs, network, vector);
  return [
    'vec3 deferred(vec3 diffuse, vec4 features, vec3 d) {', '  vec3 s0 = sin(d), c0 = cos(d);', ...harmonics, ...lines,
    `  return 1.0 / (1.0 + exp(-vec3(${outputs.join(', ')})));`, '}',
  ].join('\n');
}

// `ownNetwork` writes the network's numbers into the program, which is then specific to one content and faster than one
// that reads a buffer. Contents that are loaded and evicted often share programs, as compiling is slow.
export function volumePieces(
  { parts, network, atlases }: { parts: VolumePart[]; network: DenseLayer[]; atlases: number }, ownNetwork: boolean,
): ProgramPieces {
  const ofParts = kVectorsOfPart * parts.length;
  const packed = packNetwork(network);
  const vector = (n: number) => (ownNetwork ? writtenVector(packed, n) : `content[${ofParts + n}]`);
  const source = [kUniforms, atlasShader(kVoxelAtlases, atlases), kParts, marchSource, deferredShader(network, vector), kWrite].join('\n');
  return { parts: parts.length, vectors: vectorsOfVolume({ parts, network }), defines: {}, source };
}
