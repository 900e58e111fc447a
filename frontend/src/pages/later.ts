/** Every page that is not looked at first, in one piece: it comes while the first page is idle. */
export { ComparePage } from "./ComparePage";
export { ControllerPage } from "./ControllerPage";
export { FlightPage } from "./FlightPage";
export { FlyPage } from "./FlyPage";
export { JobsPage } from "./JobsPage";
export { NewCampaignPage } from "./NewCampaignPage";
export { NewVehiclePage } from "./NewVehiclePage";
export { ReproductionsPage } from "./ReproductionsPage";
export { SettingsPage } from "./SettingsPage";
export { VehiclePage } from "./VehiclePage";
export { VehiclesPage } from "./VehiclesPage";
