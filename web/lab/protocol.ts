// The messages between lab page and program: what `messages.ts`, made from the program's types, leaves to say.
// Quaternions are w, x, y, z, body to reference; angles are yaw, pitch, roll.

import type { Request, SensorUse } from "./messages";

export type * from "./messages";
export type { DeviceStatus as Device, InnovationPoint as Innovation, InputStatus as Input, RecordingStatus as Recording, RestNumbers as RestCalibration, ToPage as FromProgram } from "./messages";

export type Quaternion = [number, number, number, number];
export type Triple = [number, number, number];
export type SettingValue = number | string;
export type Settings = Record<string, SettingValue>;
/** The sensors of a calibration at rest. */
export type Sensor = Exclude<keyof SensorUse, "compass">;
/** The sensors in use, each on or off. */
export type Use = Record<keyof SensorUse, boolean>;

/** A request; answers to it carry its number. */
export type ToProgram = Request & { request?: number };
