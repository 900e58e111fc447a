import { Anchor, Button, Radio } from "@mantine/core";
import { Link } from "react-router";
import type { Vehicle, VehicleKindInfo } from "../../api/types";
import { StateBadge, VehicleBadge } from "../../ui/Badges";
import { autopilotTitle, vehicleStateLabel } from "../fleet/fleet";
import classes from "./NewCampaign.module.css";

interface Props {
  kinds: readonly VehicleKindInfo[];
  registered: readonly Vehicle[];
  /** Registered vehicles of other experiments; selecting one changes the experiment. */
  others: readonly Vehicle[];
  kind: string;
  vehicleId: number | null;
  error: string | undefined;
  onKind: (kind: string) => void;
  onVehicle: (vehicle: Vehicle) => void;
}

const keyOf = (vehicleId: number): string => `vehicle ${vehicleId}`;

/** Selection of a registered vehicle or a shared simulation. */
export function VehiclePicker({ kinds, registered, others, kind, vehicleId, error, onKind, onVehicle }: Props) {
  const choose = (key: string): void => {
    const chosen = registered.find(({ id }) => keyOf(id) === key);
    if (chosen === undefined) onKind(key);
    else onVehicle(chosen);
  };
  return (
    <div>
      <Radio.Group
        size="md"
        label="Vehicle"
        value={vehicleId === null ? kind : keyOf(vehicleId)}
        onChange={choose}
        error={error}
      >
        <div className={classes["cards"]}>
          {registered.map((vehicle) => (
            <Radio.Card key={vehicle.id} value={keyOf(vehicle.id)} className={classes["card"]}>
              <Top isReal={vehicle.is_real} />
              <strong>{vehicle.name}</strong>
              <span className={classes["line"]}>{autopilotTitle(vehicle)}</span>
              <StateBadge words={vehicleStateLabel(vehicle)} />
            </Radio.Card>
          ))}
          {kinds.map(({ name, title, line, is_real }) => (
            <Radio.Card key={name} value={name} className={classes["card"]}>
              <Top isReal={is_real} />
              <strong>{title}</strong>
              <span className={classes["line"]}>{line}</span>
            </Radio.Card>
          ))}
        </div>
      </Radio.Group>
      <div className={classes["more"]}>
        {others.length > 0 && <span>Vehicles that fly another experiment (choosing one changes it):</span>}
        {others.map((vehicle) => (
          <Button key={vehicle.id} variant="default" onClick={() => onVehicle(vehicle)}>
            {vehicle.name}
          </Button>
        ))}
        <Anchor component={Link} to="/vehicles/new">
          Register a vehicle
        </Anchor>
      </div>
    </div>
  );
}

function Top({ isReal }: { isReal: boolean }) {
  return (
    <span className={classes["top"]}>
      <VehicleBadge isReal={isReal} />
      <Radio.Indicator size="md" />
    </span>
  );
}
