// What went wrong with something from outside (a file, the network, the graphics card), for people.
export class SceneError extends Error {
  override name = 'SceneError';

  // `what` names the file or thing, `place` where in it (may be ''), `reason` what is wrong, `remedy` what to do.
  constructor(
    readonly what: string,
    readonly place: string,
    readonly reason: string,
    readonly remedy: string,
  ) {
    super(`${what}: ${place === '' ? '' : `${place}: `}${reason}; ${remedy}`);
  }
}
