// Replaced by what scripts/types.mjs generates.
/* eslint-disable */
export type Command = any;
export type LiveView = any;
export type NumberedView = any;
export type Open = any;
export type Opened = any;
export type View = any;
export type RigView = any;
export type RigCamera = any;
export type SeenCell = any;
export type Replay = any;
export type PlayedReading = any;
export type PlayedContact = any;
