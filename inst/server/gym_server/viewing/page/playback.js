// Shows frames live, or records a short clip, plays it slowly, and continues live.

const CLIP_SECONDS = 2;

export class Playback {
  constructor(show) {
    this.show = show;
    this.slowness = 1;
    this.paused = false;
    this.drop();
  }

  // Whether more frames are wanted: not while a complete clip is playing.
  get wants() {
    return !this.paused && !this.complete;
  }

  setSlowness(slowness) {
    this.slowness = slowness;
    this.drop();
  }

  setPaused(paused) {
    this.paused = paused;
    // After a pause, continue with the latest frame.
    this.drop();
  }

  drop() {
    clearTimeout(this.timer);
    this.timer = null;
    this.clip = [];
    // When recording started, or null. The clip may be empty meanwhile.
    this.filmed = null;
    this.complete = false;
  }

  arrive(frame) {
    if (this.paused) return;
    if (this.slowness === 1) {
      this.show(frame);
      return;
    }
    const now = performance.now();
    if (this.filmed === null) {
      this.filmed = this.played = now;
      this.clip.push({ frame, at: now });
      this.playNext();
      return;
    }
    this.clip.push({ frame, at: now });
    this.complete = now - this.filmed > CLIP_SECONDS * 1000;
    if (this.timer === null) this.playNext();
  }

  playNext() {
    const next = this.clip[0];
    if (!next) {
      // The clip is over.
      this.timer = null;
      if (this.complete || performance.now() - this.filmed > CLIP_SECONDS * 1000) this.drop();
      return;
    }
    const due = this.played + (next.at - this.filmed) * this.slowness;
    this.timer = setTimeout(() => {
      this.clip.shift();
      this.show(next.frame);
      this.playNext();
    }, Math.max(0, due - performance.now()));
  }
}
