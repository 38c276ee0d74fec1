// Converts a picture, that is, one camera of an image, to the view that the tile selection uses.
import * as THREE from 'three';
import { isParallel, type Picture } from './draw/picture';
import { showsBackgroundBlock, TileView, type Plane } from './stream/tile-view';
import type { Box, Tileset } from './tiles/tileset';

// Returns the view in scene units.
export function tileView({ near, box }: Pick<Tileset, 'near' | 'box'>, picture: Picture, worldFromScene: THREE.Matrix4): TileView {
  const { camera, part, eye, clipFromScene: { elements } } = picture;
  const row = (i: number): Plane => [elements[i], elements[4 + i], elements[8 + i], elements[12 + i]];
  const w = row(3);
  const sides = [0, 1].flatMap((i) => {
    const r = row(i);
    return [1, -1].map((sign): Plane => [w[0] + sign * r[0], w[1] + sign * r[1], w[2] + sign * r[2], w[3] + sign * r[3]]);
  });
  const parallel = isParallel(camera);
  // The near and far planes are omitted, as rays are not limited by them.
  const planes = parallel ? sides : [w, ...sides];
  const projection = camera.projectionMatrix.elements;
  const scale = new THREE.Vector3().setFromMatrixScale(worldFromScene).x;
  const focal = 0.5 * Math.max(projection[0] * part.z, projection[5] * part.w) * (parallel ? scale : 1);
  const pixels = part.z * part.w;
  return new TileView(eye, planes, focal, pixels, near, parallel, pixels * shareOfBackgroundBlock(box, picture));
}

// Returns the share of the image whose rays leave the scene's box and show the background block.
function shareOfBackgroundBlock(box: Box, { origin, ray }: Picture): number {
  const kAcross = 12;
  let shows = 0;
  for (let i = 0; i < kAcross ** 2; ++i) {
    const at = new THREE.Vector3((2 * ((i % kAcross) + 0.5)) / kAcross - 1, (2 * (Math.floor(i / kAcross) + 0.5)) / kAcross - 1, 1);
    const direction = at.clone().applyMatrix3(ray);
    shows += showsBackgroundBlock(at.applyMatrix3(origin).toArray(), direction.toArray(), box) ? 1 : 0;
  }
  return shows / kAcross ** 2;
}
