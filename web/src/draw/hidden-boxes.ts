export const kMaxHiddenBoxes = 8; // boxes set by the user, and as many again in the background block alone
