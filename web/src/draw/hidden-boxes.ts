export const kMostHiddenBoxes = 8; // of somebody's, and as many in the surround alone
