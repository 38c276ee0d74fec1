// A view in the fragment of the page's address: #eye=x,y,z&target=x,y,z&fov=degrees, in the capture's world (z up).
import * as THREE from 'three';
import { kYUpFromZUp, kZUpFromYUp } from '../../axes';
import type { Look } from '../moving/navigation';

export interface View extends Look {
  fov: number; // vertical, in degrees
}

function text(place: THREE.Vector3): string {
  return place.clone().applyMatrix4(kZUpFromYUp).toArray().map((x) => String(Number(x.toPrecision(9)))).join(',');
}

function place(given: string | null): THREE.Vector3 | undefined {
  const numbers = (given ?? '').split(',').map((part) => (part.trim() === '' ? NaN : Number(part)));
  if (numbers.length !== 3 || !numbers.every((x) => Math.abs(x) < 1e9)) return undefined;
  return new THREE.Vector3().fromArray(numbers).applyMatrix4(kYUpFromZUp);
}

export function formatView({ eye, target, fov }: View): string {
  return `eye=${text(eye)}&target=${text(target)}&fov=${Number(fov.toFixed(2))}`;
}

// Returns undefined if the text contains no view.
export function parseView(given: string): View | undefined {
  const words = new URLSearchParams(given.replace(/^#/, ''));
  const eye = place(words.get('eye'));
  const target = place(words.get('target'));
  if (!eye || !target || eye.distanceTo(target) < 1e-6) return undefined;
  const fov = Number(words.get('fov') ?? 50);
  return { eye, target, fov: fov >= 5 && fov <= 120 ? fov : 50 };
}
