// A phone whose sensors follow a script: a real page, fed through the DevTools protocol.
import { atTheEnd } from "./browser.mjs";

/** The sensors that a page needs which has the sensor interface. */
export const GENERIC_SENSORS = ["accelerometer", "gyroscope", "absolute-orientation", "magnetometer"];
const SENSORS = ["accelerometer", "linear-acceleration", "gravity", "gyroscope", "absolute-orientation", "relative-orientation", "magnetometer"];
const G = 9.81, FIELD = [22, -42];
const TURN_S = 0.1;

/**
 * A hand that turns a phone about the phone's y axis, and knows where it is. It is told where to go;
 * on a busy computer, where steps come late, it measures the way it has really made, so that rates,
 * directions and attitude always belong together.
 */
export class Hand {
  angle = 0;
  #rate = 0;
  #at = null;
  #from = 0;
  #to = 0;
  #begun = -Infinity;
  #lasts = 1;
  #now = 0;
  #noise = 1;

  /** `bias` is what the gyroscope shows at rest, rad/s. */
  constructor(bias = [0, 0, 0]) {
    this.bias = bias;
  }

  /** Turns to `degrees` from the start, in `seconds`. */
  turn(degrees, seconds) {
    [this.#from, this.#to, this.#begun, this.#lasts] = [this.#to, (degrees * Math.PI) / 180, this.#now, seconds];
  }

  /** Whether it holds still at where it was told to go. */
  get rests() {
    return this.#rate === 0 && this.angle === this.#to;
  }

  /** The angle now, degrees. */
  get degrees() {
    return (this.angle * 180) / Math.PI;
  }

  #wanted(t) {
    const u = Math.min(1, Math.max(0, (t - this.#begun) / this.#lasts));
    return this.#from + (this.#to - this.#from) * (u - Math.sin(2 * Math.PI * u) / (2 * Math.PI));
  }

  /** Noise of a small standard deviation; the same in every run. A sensor without any looks broken, and is. */
  #noisy(values, std) {
    return values.map((value) => {
      let sum = 0;
      for (let i = 0; i < 12; i++) sum += (this.#noise = (this.#noise * 48271) % 2147483647) / 2147483647;
      return value + std * (sum - 6);
    });
  }

  /** The readings at `t` seconds: specific force (m/s²), rate (rad/s), field (µT), attitude (x, y, z, w). */
  readings(t) {
    this.#now = t;
    const passed = this.#at === null ? 0 : t - this.#at;
    this.angle += this.#rate * passed;
    this.#at = t;
    // As far ahead as the next step will be late: a hand that looks less far swings.
    const ahead = Math.max(TURN_S, 1.5 * passed);
    this.#rate = (this.#wanted(t + ahead) - this.angle) / ahead;
    // The last hundredth of a degree at once, so that rest is rest.
    if (t > this.#begun + this.#lasts && Math.abs(this.#to - this.angle) < 2e-4) {
      this.#rate = 0;
      this.angle = this.#to;
    }
    const [c, s] = [Math.cos(this.angle), Math.sin(this.angle)];
    return {
      force: this.#noisy([-G * s, 0, G * c], 0.05),
      rate: this.#noisy([this.bias[0], this.bias[1] + this.#rate, this.bias[2]], 0.0015),
      field: this.#noisy([-FIELD[1] * s, FIELD[0], FIELD[1] * c], 0.2),
      attitude: [0, Math.sin(this.angle / 2), 0, Math.cos(this.angle / 2)],
    };
  }
}

/** Counts in the page what its sensors deliver, apart from what the page makes of it. */
function countReadings() {
  window.northingTaken = 0;
  if (!window.Sensor) return;
  const listen = Sensor.prototype.addEventListener;
  Sensor.prototype.addEventListener = function (type, listener, ...rest) {
    if (type !== "reading") return listen.call(this, type, listener, ...rest);
    return listen.call(this, type, (event) => { window.northingTaken++; listener(event); }, ...rest);
  };
}

/**
 * A page at `url` in a phone's window, whose sensors follow `hand`. Overrides come before the page: a page that
 * already listens gets nothing. `init` runs in the page before anything else. `sensors` are those that are fed.
 */
export async function phone(browser, url, hand = new Hand(), { init, everyMs = 15, locale, sensors = SENSORS, reducedMotion = null } = {}) {
  const context = await browser.newContext({ reducedMotion, viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, ignoreHTTPSErrors: true, ...(locale ? { locale } : {}) });
  const page = await context.newPage();
  await page.addInitScript(countReadings);
  if (init) await page.addInitScript(init);
  const cdp = await context.newCDPSession(page);
  for (const type of sensors) await cdp.send("Emulation.setSensorOverrideEnabled", { enabled: true, type, metadata: { available: true, minimumFrequency: 1, maximumFrequency: Math.min(60, Math.ceil(1500 / everyMs)) } });
  await page.goto(url);
  const started = performance.now();
  let stopped = false, feeding = null;
  const feed = async () => {
    while (!stopped) {
      const { force, rate, field, attitude } = hand.readings((performance.now() - started) / 1000);
      const xyz = ([x, y, z]) => ({ xyz: { x, y, z } });
      const quaternion = { quaternion: { x: attitude[0], y: attitude[1], z: attitude[2], w: attitude[3] } };
      const readings = { accelerometer: xyz(force), "linear-acceleration": xyz([0, 0, 0]), gravity: xyz(force), gyroscope: xyz(rate), magnetometer: xyz(field), "absolute-orientation": quaternion, "relative-orientation": quaternion };
      await Promise.all(sensors.map((type) => cdp.send("Emulation.setSensorOverrideReadings", { type, reading: readings[type] }).catch(() => undefined)));
      await new Promise((done) => setTimeout(done, everyMs));
    }
  };
  feeding = feed();
  const self = {
    page, hand,
    /** Gives it a name and taps the button. */
    start: async (name) => {
      if (name) await page.fill("#name", name);
      await page.click("#go");
    },
    state: () => page.locator("#state").textContent(),
    detail: () => page.locator("#detail").textContent(),
    said: () => page.locator("#say").textContent(),
    /** The numbers under the sensors: `Received`, `Waiting`, ... */
    fact: async (name) => page.locator("#link div", { hasText: name }).locator("dd").textContent(),
    /** Readings that the page's sensors have delivered. */
    taken: () => page.evaluate(() => window.northingTaken),
    /** Ends the sensors; the page stays. */
    still: async () => {
      stopped = true;
      await feeding;
    },
    close: async () => {
      await self.still();
      await context.close();
    },
  };
  atTheEnd(self.close);
  return self;
}

/** Makes a page take itself to run on an iPhone in Safari. */
export function asInSafari() {
  for (const name of ["Accelerometer", "Gyroscope", "Magnetometer", "LinearAccelerationSensor", "GravitySensor", "AbsoluteOrientationSensor", "RelativeOrientationSensor", "Sensor"]) delete window[name];
  Object.defineProperty(navigator, "userAgent", { get: () => "Mozilla/5.0 (iPhone; CPU iPhone OS 18_5 like Mac OS X) AppleWebKit/605.1.15 (KHTML, like Gecko) Version/18.5 Mobile/15E148 Safari/604.1" });
  Object.defineProperty(navigator, "platform", { get: () => "iPhone" });
  // Safari refuses a WebSocket to a self-made certificate: an error after the constructor has returned.
  window.WebSocket = class extends EventTarget {
    readyState = 0;
    constructor() {
      super();
      setTimeout(() => { this.readyState = 3; this.onerror?.(new Event("error")); this.onclose?.(new CloseEvent("close", { code: 1006 })); }, 20);
    }
    send() { throw new DOMException("still connecting", "InvalidStateError"); }
    close() {}
  };
  // Permission only in a tap, and no events before it was given.
  window.northingAsked = [];
  const granted = {};
  for (const name of ["DeviceMotionEvent", "DeviceOrientationEvent"]) {
    window[name].requestPermission = () => {
      window.northingAsked.push(name);
      if (!navigator.userActivation.isActive) return Promise.reject(new DOMException("requires a user gesture", "NotAllowedError"));
      granted[name] = true;
      return Promise.resolve("granted");
    };
  }
  delete window.ondeviceorientationabsolute;
  delete Window.prototype.ondeviceorientationabsolute;
  const listen = window.addEventListener.bind(window);
  const minus = (v) => v && { x: -v.x, y: -v.y, z: -v.z };
  window.addEventListener = (type, listener, ...rest) => {
    if (type === "devicemotion") {
      // The opposite sign of both accelerations, and an interval in seconds.
      return listen(type, (e) => granted.DeviceMotionEvent && listener({ timeStamp: e.timeStamp, interval: 0.0166, rotationRate: e.rotationRate, acceleration: minus(e.acceleration), accelerationIncludingGravity: minus(e.accelerationIncludingGravity) }), ...rest);
    }
    if (type === "deviceorientation") {
      // Any zero for alpha, no word about `absolute`, and the compass: the script points north.
      return listen(type, (e) => granted.DeviceOrientationEvent && listener({ timeStamp: e.timeStamp, alpha: e.alpha === null ? null : (e.alpha + 70) % 360, beta: e.beta, gamma: e.gamma, webkitCompassHeading: 0, webkitCompassAccuracy: 10 }), ...rest);
    }
    return listen(type, listener, ...rest);
  };
}
