import { Radio } from "@mantine/core";
import type { VehicleKindInfo } from "../api/types";
import { VehicleBadge } from "./VehicleBadge";
import classes from "./VehiclePicker.module.css";

interface Props {
  kinds: readonly VehicleKindInfo[];
  value: string;
  error: string | undefined;
  onChange: (kind: string) => void;
}

export function VehiclePicker({ kinds, value, error, onChange }: Props) {
  return (
    <Radio.Group size="md" label="Vehicle" value={value} onChange={onChange} error={error}>
      <div className={classes["cards"]}>
        {kinds.map((kind) => (
          <Radio.Card key={kind.name} value={kind.name} className={classes["card"]}>
            <span className={classes["top"]}>
              <VehicleBadge isReal={kind.is_real} />
              <Radio.Indicator size="md" />
            </span>
            <strong>{kind.title}</strong>
            <span className={classes["line"]}>{kind.line}</span>
          </Radio.Card>
        ))}
      </div>
    </Radio.Group>
  );
}
