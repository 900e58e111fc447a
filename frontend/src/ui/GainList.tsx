import { Fragment } from "react";
import { gainText } from "./format";
import classes from "./GainList.module.css";
import { useGainTitles } from "./useUnits";

interface Props {
  gains: Readonly<Record<string, number>>;
  experiment: string;
}

/** Gains in a line, to four digits; the title has the name and the full number. */
export function GainList({ gains, experiment }: Props) {
  const titles = useGainTitles(experiment);
  return (
    <span className={classes["list"]}>
      {Object.entries(gains).map(([name, value], index) => (
        <Fragment key={name}>
          {index > 0 && " · "}
          <span title={`${titles[name] ?? name}: ${value}`}>
            {name} {gainText(value)}
          </span>
        </Fragment>
      ))}
    </span>
  );
}
