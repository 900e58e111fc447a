/** A value outside of React that components subscribe to. */

type Listener = () => void;

export class Store<Value> {
  private value: Value;
  private readonly listeners = new Set<Listener>();

  constructor(value: Value) {
    this.value = value;
  }

  readonly get = (): Value => this.value;

  readonly set = (value: Value): void => {
    this.value = value;
    for (const listener of this.listeners) listener();
  };

  readonly subscribe = (listener: Listener): (() => void) => {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  };
}
