import * as THREE from 'three';

// Capture worlds have z up; three.js has y up.
export const kYUpFromZUp = new THREE.Matrix4().set(1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1);
export const kZUpFromYUp = kYUpFromZUp.clone().invert();
