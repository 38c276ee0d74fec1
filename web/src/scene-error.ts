// An error about external input (a file, the network, the GPU), with a text for users.
export class SceneError extends Error {
  override name = 'SceneError';

  // `what` names the file or thing, `place` the position in it (may be ''), `reason` what is wrong, `remedy` what to do
  // about it. `isFinal`: that trying again cannot help, as with what is too large for the GPU.
  constructor(
    readonly what: string,
    readonly place: string,
    readonly reason: string,
    readonly remedy: string,
    readonly isFinal = false,
  ) {
    super(`${what}: ${place === '' ? '' : `${place}: `}${reason}; ${remedy}`);
  }
}
