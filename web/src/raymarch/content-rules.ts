// The rules for parts (docs/tile-format.md, sections 5 to 7). Each function returns the first violation as text for
// users.
import type { DeclaredContent } from '../tiles/content-codec';
import { kFarthestInScene, type Broken } from '../tiles/tileset-rules';
import type { ContentPart } from './content';

export const kMaxStored = 606 * 606; // macroblocks in an image of 16383 pixels a side
const kAxes = [0, 1, 2];

// Number of macroblocks for `texels` along an axis.
export function ruleOfMacroblocks(part: ContentPart, texels: number): Broken {
  return part.stored > (texels / 8) ** 3 ? 'it stores more macroblocks than its grid has' : undefined;
}

// A bounded part owns nothing outside its domain, up to rounding.
export function ruleOfPlace(part: ContentPart): Broken {
  for (const a of kAxes) {
    const [centre, scale, low, high] = [part.centre[a], part.scale[a], part.low[a], part.high[a]];
    if (!(Math.abs(centre) <= kFarthestInScene) || !(scale >= 1e-6 && scale <= kFarthestInScene)) {
      return 'its centre or scale is out of bounds';
    }
    if (!(low >= -kFarthestInScene && low < high && high <= kFarthestInScene)) return 'its box is empty or out of bounds';
    const slack = 1e-3 * scale;
    if (!part.contracted && (low < centre - scale - slack || high > centre + scale + slack)) {
      return 'it is bounded, but its box is not within its domain';
    }
  }
  return part.backgroundBlock && !part.contracted ? 'a background block is not contracted' : undefined;
}

export function ruleOfParts<Part extends ContentPart>(parts: Part[], ruleOfPart: (part: Part) => Broken): Broken {
  for (const [i, one] of parts.entries()) {
    const broken = ruleOfPart(one);
    if (broken) return `part ${i}: ${broken}`;
    if (one.backgroundBlock && parts.length > 1) return 'a background block is not alone';
    const other = parts.findIndex((part, j) => j < i && overlap(part, one));
    if (other !== -1) return `parts ${other} and ${i} overlap`;
  }
  return undefined;
}

function overlap(one: ContentPart, other: ContentPart): boolean {
  return kAxes.every((a) => {
    const slack = 1e-3 * Math.min(one.scale[a], other.scale[a]);
    return one.high[a] > other.low[a] + slack && other.high[a] > one.low[a] + slack;
  });
}

// Returns how the content differs from what tileset.json declares.
export function mismatchWithTileset(parts: ContentPart[], declared: DeclaredContent): Broken {
  const slack = (x: number) => 1e-6 * Math.max(1, Math.abs(x)); // parts are rounded to floats
  for (const [i, part] of parts.entries()) {
    if (part.backgroundBlock !== declared.backgroundBlock) {
      return `part ${i} is ${part.backgroundBlock ? 'a' : 'not a'} background block, and tileset.json says that the content is ${declared.backgroundBlock ? 'one' : 'not'}`;
    }
    const { low, high } = declared.box;
    if (kAxes.some((a) => part.low[a] < low[a] - slack(low[a]) || part.high[a] > high[a] + slack(high[a]))) {
      return `part ${i} owns what lies outside of the content's box in tileset.json`;
    }
  }
  return undefined;
}
