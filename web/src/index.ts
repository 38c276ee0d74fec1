// The public API of the library: a scene as an object of three.js.
export { kYUpFromZUp } from './axes';
export { kDisplayModes, type DisplayMode } from './representations/drawers';
export { TesseraScene, type SceneOptions, type SceneStatistics } from './scene';
export { updateScenes } from './scenes';
export { kMaxHiddenBoxes } from './draw/hidden-boxes';
export { SceneError } from './scene-error';
export { ChosenFiles, ServedFiles, type SceneFiles } from './scene-files';
export type { SelectionSettings } from './stream/tile-selector';
export type { StreamSettings } from './stream/tile-streamer';
export type { Georeference, Tileset } from './tiles/tileset';
