// Icons of lines on a grid of 20 × 20.
const kIcons = {
  home: 'M3 9.5 10 3.5l7 6M5 8.5V16h10V8.5',
  map: 'M10 3v14M3 10h14M10 3 8 5M10 3l2 2M10 17l-2-2M10 17l2-2M3 10l2-2M3 10l2 2M17 10l-2-2M17 10l-2 2',
  orbit: 'M10 12a2 2 0 1 0 0-4 2 2 0 0 0 0 4M3 10c0-2 3-3.5 7-3.5s7 1.500 7 3.500-3 3.500-7 3.500M10 13.500l2.200-1.800M10 13.500l2.200 1.800',
  fly: 'M17 3 3 9l5.500 2.500L11 17z M8.500 11.500 17 3',
  ruler: 'M3 13 13 3l4 4L7 17z M6 10l1.500 1.500M8.500 7.500 10 9M11 5l1.500 1.500',
  cube: 'M10 3 16.500 6.500v7L10 17l-6.500-3.500v-7z M3.500 6.500 10 10l6.500-3.500M10 10v7',
  bookmark: 'M5.500 3h9v14L10 13.500 5.500 17z',
  camera: 'M3 6.500h3.500L8 4.500h4l1.500 2H17V16H3z M10 13.500a2.700 2.700 0 1 0 0-5.400 2.700 2.700 0 0 0 0 5.400',
  sliders: 'M4 6h7M15 6h1M4 14h1M9 14h7M13 4.200v3.600M7 12.200v3.600',
  chart: 'M3.500 16.500h13M5.500 14V9.500M9 14V5M12.500 14V8M15.500 14v-3',
  help: 'M7.300 7.500a2.700 2.700 0 1 1 4.200 2.200c-1 .7-1.500 1.200-1.500 2.300M10 15.200v.3',
  eye: 'M2.500 10s3-5 7.500-5 7.500 5 7.500 5-3 5-7.500 5-7.500-5-7.500-5 M10 12.200a2.200 2.200 0 1 0 0-4.400 2.200 2.200 0 0 0 0 4.400',
  hide: 'M2.500 10s3-5 7.500-5 7.500 5 7.500 5-3 5-7.500 5-7.500-5-7.500-5 M4 16.500 16 3.500',
  copy: 'M7.500 7.500h9v9h-9z M4.500 12.500h-1v-9h9v1',
  bin: 'M4 5.500h12M8 5.500v-2h4v2M5.500 5.500l.8 11h7.400l.8-11',
  headset: 'M3 6.500h14V14h-4.500L10 11.500 7.500 14H3z M6 9.500h1.500M12.500 9.500H14',
  close: 'M5 5l10 10M15 5 5 15',
} as const;
export type IconName = keyof typeof kIcons;

export function icon(name: IconName): SVGSVGElement {
  const space = 'http://www.w3.org/2000/svg';
  const svg = document.createElementNS(space, 'svg');
  svg.setAttribute('viewBox', '0 0 20 20');
  svg.setAttribute('aria-hidden', 'true');
  const path = document.createElementNS(space, 'path');
  path.setAttribute('d', kIcons[name]);
  svg.append(path);
  return svg;
}
